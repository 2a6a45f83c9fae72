//! An interrupted job stores its finished runs, and resumes from them.

use std::{fs, path::Path};

use crate::disc::Disc;
use crate::line::{json, run_in, solved, timeless};
use proptest::prelude::*;
use serde_json::Value;

const EVALUATE: &str = "evaluate --runs 9 --size 16 --steps 5";
const COMPARE: &str =
    "evaluate --runs 9 --size 16 --steps 5 --baseline 'logistic_--learning-rate_0.02'";
const SEARCH: &str = "search --runs 6 --search-runs 5 --size 16 --steps 4 --schedule static --scales 0.1,0.2 \
                      --learning-rates 0.02,0.5 --loops 40";

/// Runs the line to its end, continuing from the folder.
fn resumed(out: &Path, line: &str) -> Value {
    let (stdout, ended) = run_in::<Disc>(out, &format!("{line} --resume"));
    ended.unwrap();
    json(&stdout)
}

fn assert_same_files(one: &Path, other: &Path, names: &[&str]) {
    for name in names {
        assert!(fs::read(one.join(name)).unwrap() == fs::read(other.join(name)).unwrap(), "{name}");
    }
}

/// The beginning of a text: this many whole lines and half of the next.
fn cut(text: &str, lines: usize) -> String {
    let mut parts = text.split_inclusive('\n');
    let mut whole: String = parts.by_ref().take(lines).collect();
    whole.push_str(parts.next().map_or("", |next| &next[..next.len() / 2]));
    whole
}

#[test]
fn what_a_kill_leaves_is_gone_on_from_to_the_same_results() {
    let files = ["curve.csv", "convergence.csv", "before_after.png", "animation.gif"];
    let cases: [(&str, &str, &[&str]); 3] = [
        (EVALUATE, "evaluate.jsonl", &files),
        (COMPARE, "evaluate.jsonl", &["against_curve.csv", "convergence.csv"]),
        (SEARCH, "search.jsonl", &["curve.csv", "convergence.csv"]),
    ];
    for (line, name, files) in cases {
        let (whole, expected) = solved::<Disc>(line);
        let text = fs::read_to_string(whole.path().join(name)).unwrap();
        let lines = text.lines().count();
        for kept in [0, 1, lines / 2, lines - 1, lines] {
            let out = tempfile::tempdir().unwrap();
            fs::write(out.path().join(name), cut(&text, kept)).unwrap();
            assert_eq!(timeless(resumed(out.path(), line)), timeless(expected.clone()), "{line}");
            assert_same_files(whole.path(), out.path(), files);
            let after = fs::read_to_string(out.path().join(name)).unwrap();
            assert!(after.starts_with(
                &cut(&text, kept)
                    [..after.len().min(cut(&text, kept).rfind('\n').map_or(0, |at| at + 1))]
            ));
            assert_eq!(after.lines().count(), lines, "what was finished is not made again");
        }
    }
}

#[test]
fn runs_of_another_job_are_neither_used_nor_lost() {
    let (out, _) = solved::<Disc>(EVALUATE);
    let journal = out.path().join("evaluate.jsonl");
    let before = fs::read_to_string(&journal).unwrap();
    // The first seed of a batch has pictures.
    for (more, made) in [("--radius 0.3", 9), ("--seed 1", 2), ("--scale 0.1", 9)] {
        let at = fs::read_to_string(&journal).unwrap();
        let line = format!("{EVALUATE} {more}");
        let (_, fresh) = solved::<Disc>(&line);
        assert_eq!(timeless(resumed(out.path(), &line)), timeless(fresh));
        let after = fs::read_to_string(&journal).unwrap();
        assert!(after.starts_with(&at) && after.starts_with(&before));
        assert_eq!(after.lines().count() - at.lines().count(), made, "{more}");
    }
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(40))]

    /// Bytes changed, lines doubled, dropped and swapped, the file cut: the results are those of an undamaged one.
    #[test]
    fn a_damaged_cache_costs_time_and_nothing_else(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..5_u8), 1..6)
    ) {
        static WHOLE: std::sync::LazyLock<(String, String, Value)> = std::sync::LazyLock::new(|| {
            let (out, json) = solved::<Disc>("evaluate --runs 3 --size 8 --steps 2");
            let text = |name: &str| fs::read_to_string(out.path().join(name)).unwrap();
            (text("evaluate.jsonl"), text(".softrast.json"), timeless(json))
        });
        let (text, list, expected) = &*WHOLE;
        let mut bytes = text.clone().into_bytes();
        for (at, byte, kind) in changes {
            if bytes.is_empty() { break; }
            let k = at.index(bytes.len());
            match kind {
                0 => bytes[k] = byte,
                1 => bytes.truncate(k),
                2 => { bytes.remove(k); }
                3 => bytes.insert(k, byte),
                _ => { let again = bytes[k..].to_vec(); bytes.extend(again); }
            }
        }
        let out = tempfile::tempdir().unwrap();
        fs::write(out.path().join("evaluate.jsonl"), bytes).unwrap();
        // A folder with stored runs has a list that names them.
        fs::write(out.path().join(".softrast.json"), list).unwrap();
        prop_assert_eq!(&timeless(resumed(out.path(), "evaluate --runs 3 --size 8 --steps 2")), expected);
    }
}

/// The example as a program, which cargo builds along with its tests.
#[cfg(unix)]
pub(crate) fn program() -> std::path::PathBuf {
    let mut path = std::env::current_exe().unwrap();
    path.pop();
    path.pop();
    path.join("examples/disc")
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_program_after_its_step_with_what_is_finished() {
    use std::{process::Command, thread::sleep, time::Duration};
    let program = program();
    assert!(program.exists(), "{program:?} is missing: run the tests of the whole package");
    let out = tempfile::tempdir().unwrap();
    let line = "evaluate --size 8 --runs 100000 --json --quiet --out";
    let mut child = Command::new(program)
        .args(line.split(' '))
        .arg(out.path())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    while !out.path().join("evaluate.jsonl").exists() {
        sleep(Duration::from_millis(20));
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let part = json(&String::from_utf8(output.stdout).unwrap());
    let finished = part["partial"]["finished"].as_u64().unwrap();
    assert!((4..100_000).contains(&finished) && part["runs"] == finished, "{part}");
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("Stopped:"));
}
