//! The program does not touch files that it has not created.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may panic, and does not need all that tests share"
)]

#[path = "../../../tests/support/kept.rs"]
mod kept;

use std::{fs, path::Path};

use kept::Program;

const STABILITY: Program = Program {
    path: env!("CARGO_BIN_EXE_stability"),
    inputs,
    short: "--cases O06 --methods logistic --quiet",
};

fn inputs(folder: &Path) {
    fs::create_dir(folder.join("work")).unwrap();
    let network =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../inverse/learned/occlusion-mlp.json");
    for name in ["mlp.json", "work/stability.json"] {
        fs::copy(&network, folder.join(name)).unwrap();
    }
}

const LINES: &[(&str, &str)] = &[
    ("--mlp mlp.json --out .", ""),
    ("--mlp work/stability.json --out work", "stability.json is an input of this run"),
    ("--out work", "stability.json is not a recorded result"),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    STABILITY.keeps_inputs(LINES);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    STABILITY.every_flag_is_in(&[""], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    STABILITY.prints_no_control_codes(&[
        "--mlp IN/mlp.json --out IN/out",
        "--mlp IN/none-mlp.json --out IN/out",
    ]);
}
