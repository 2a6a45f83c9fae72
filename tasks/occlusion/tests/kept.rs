//! The program does not touch files of others.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may panic, and does not need all that tests share"
)]

#[path = "../../../tests/support/kept.rs"]
mod kept;

use std::{fs, path::Path};

use kept::{Program, SOFTNESS};

const OCCLUSION: Program =
    Program { path: env!("CARGO_BIN_EXE_occlusion"), inputs, short: "--size 8 --steps 1 --quiet" };

fn inputs(folder: &Path) {
    let depth = r#"{ "depth_softness": "exp", "phi": [-2.0, -0.5] }"#;
    fs::write(folder.join("softness.json"), SOFTNESS).unwrap();
    fs::write(folder.join("depth.json"), depth).unwrap();
    fs::write(folder.join("depth_softness.json"), depth).unwrap();
}

const LINES: &[(&str, &str)] = &[
    ("--softness softness.json --depth-softness depth.json --out .", ""),
    ("evaluate --runs 1 --depth-softness depth_softness.json --baseline softness.json --out .", ""),
    (
        "learn --updates 1 --batch 1 --validation-runs 1 --softness softness.json --out .",
        "softness.json is an input of this run",
    ),
    (
        "learn --updates 1 --batch 1 --validation-runs 1 --out .",
        "softness.json is not a recorded result",
    ),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    OCCLUSION.keeps_inputs(LINES);
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    fs::remove_file(folder.path().join("softness.json")).unwrap();
    let line = "learn --updates 1 --batch 1 --validation-runs 1 --depth-softness depth_softness.json --out .";
    let before = kept::files(folder.path());
    let ended = OCCLUSION.run(folder.path(), line);
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(said.contains("depth_softness.json is an input of this run"), "{said}");
    assert_eq!(kept::files(folder.path()), before);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    OCCLUSION.every_flag_is_in(&["solve", "evaluate", "search", "choose", "learn"], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    OCCLUSION.prints_no_control_codes(&[
        "--out IN/out",
        "--json --out IN/out",
        "learn --updates 1 --batch 1 --validation-runs 1 --json --out IN/out-learn",
    ]);
}
