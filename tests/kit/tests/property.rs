//! Property tests draw the same cases in every run, and replay failed ones.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{
    cell::{Cell, RefCell},
    fs,
};

use proptest::{
    prelude::*,
    test_runner::{Config, TestRunner},
};
use softrast_test_kit::cases;

#[test]
fn two_runs_draw_the_same_cases() {
    let drawn = || {
        let drawn = RefCell::new(Vec::new());
        let draw = |x| {
            drawn.borrow_mut().push(x);
            Ok(())
        };
        TestRunner::new(cases(8)).run(&any::<u64>(), draw).unwrap();
        drawn.into_inner()
    };
    let first = drawn();
    assert_eq!(first.len(), 8);
    assert_eq!(drawn(), first);
}

#[test]
fn a_case_that_fails_is_kept_beside_its_test_and_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let test = folder.path().join("some_test.rs");
    fs::write(&test, "").unwrap();
    let source: &'static str = test.to_string_lossy().into_owned().leak();
    let run = |fails: bool| {
        let config = Config { source_file: Some(source), ..cases(64) };
        let first = Cell::new(None);
        let ended = TestRunner::new(config).run(&any::<u64>(), |x| {
            first.set(first.get().or(Some(x)));
            prop_assert!(!fails || x < 1000);
            Ok(())
        });
        (ended.is_ok(), first.get())
    };
    let (passed, _) = run(true);
    assert!(!passed);
    let kept = fs::read_to_string(folder.path().join("some_test.proptest-regressions")).unwrap();
    assert!(kept.contains("cc ") && kept.contains("shrinks to"), "{kept}");
    let (passed, replayed) = run(false);
    assert!(passed && replayed.unwrap() >= 1000, "{replayed:?}");
}
