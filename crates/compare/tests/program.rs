//! The whole program on two small cells.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, process::Command};

use softrast_test_kit::{Program, ended};

#[test]
fn a_comparison_is_not_done_twice() {
    let out = tempfile::tempdir().unwrap();
    let compare = || {
        let line = "--tasks occlusion --methods exp --runs 1 --quiet --out";
        let words = line.split_whitespace();
        let program = env!("CARGO_BIN_EXE_compare");
        let output = Command::new(program).args(words).arg(out.path()).output().unwrap();
        let said = String::from_utf8(output.stdout).unwrap();
        assert!(said.starts_with("2 cells, tables in"), "{said} {:?}", output.stderr);
        let journal = out.path().join("runs.jsonl");
        let tables = fs::read_to_string(out.path().join("results.md")).unwrap();
        let report = fs::read_to_string(out.path().join("report.html")).unwrap();
        assert!(
            report.contains("<svg")
                && out.path().join("results/occlusion-original-pareto.csv").exists()
        );
        (tables, fs::read(journal).unwrap())
    };
    let first = compare();
    assert!(first.0.matches("\n| exp |").count() == 2, "{}", first.0);
    assert_eq!(compare(), first);
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    let out = tempfile::tempdir().unwrap();
    let mut command = Program::new(env!("CARGO_BIN_EXE_compare")).on_one_thread().command();
    let line = "--tasks occlusion --methods exp --runs 1 --quiet --out";
    let output = ended(command.args(line.split_whitespace()).arg(out.path()));
    assert!(output.status.success(), "{output:?}");
}
