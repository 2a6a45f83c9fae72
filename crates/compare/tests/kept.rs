//! The program does not touch files that it has not created.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may panic, and does not need all that tests share"
)]

#[path = "../../../tests/support/kept.rs"]
mod kept;

use std::{fs, path::Path};

use kept::{Program, SOFTNESS};

const COMPARE: Program = Program { path: env!("CARGO_BIN_EXE_compare"), inputs, short: "--quiet" };

fn inputs(folder: &Path) {
    for (name, text) in [
        ("softness.json", SOFTNESS),
        ("notes.md", "mine"),
        ("broken.md", "<!-- table tasks -->"),
        ("work/cells.jsonl", "mine"),
        ("runs/runs.jsonl", "mine"),
        ("page/report.html", "mine"),
    ] {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
}

const LINES: &[(&str, &str)] = &[
    (
        "--tasks occlusion --methods softness.json --varied= --crossed= --runs 1 --out . --tables new.md",
        "",
    ),
    (
        "--tasks occlusion --methods exp --varied softness.json --runs 1 --tables notes.md",
        "notes.md is not a recorded result",
    ),
    (
        "--tasks occlusion --methods exp --runs 1 --tables work.md",
        "work/cells.jsonl is not a recorded result",
    ),
    (
        "--tasks occlusion --methods exp --runs 1 --tables softness.json",
        "softness.json is not a recorded result",
    ),
    ("--tasks occlusion --methods exp --runs 1 --out runs", "runs.jsonl"),
    ("--tasks occlusion --methods exp --runs 1 --out page", "report.html is not a recorded result"),
    ("--recompute broken.md", "has no end"),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    COMPARE.keeps_inputs(LINES);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    COMPARE.every_flag_is_in(&[""], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    let line = "--tasks occlusion --methods exp --varied= --crossed= --runs 1 --json --out IN/out";
    COMPARE.prints_no_control_codes(&[
        line,
        "--recompute IN/notes.md",
        "--recompute IN/none-notes.md",
    ]);
}
