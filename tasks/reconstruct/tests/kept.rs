//! The program does not touch files of others.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may panic, and does not need all that tests share"
)]

#[path = "../../../tests/support/kept.rs"]
mod kept;

use std::{fs, path::Path};

use kept::{OCTAHEDRON, Program, SOFTNESS};

const RECONSTRUCT: Program = Program { path: env!("CARGO_BIN_EXE_reconstruct"), inputs, short: "" };

fn inputs(folder: &Path) {
    for (name, text) in [
        ("softness.json", SOFTNESS),
        ("mesh.obj", OCTAHEDRON),
        ("notes.txt", "mine"),
        ("report.html", "mine"),
        ("checkpoint.bin", "mine"),
        ("compared/compare.md", "mine"),
        ("sheets/epoch_001.png", "mine"),
    ] {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
}

const LINES: &[(&str, &str)] = &[
    ("train --quick --quiet --softness softness.json --out .", "checkpoint.bin is there already"),
    ("train --quick --quiet --resume --out .", "not a checkpoint"),
    (
        "train --quick --quiet --pairs 2 --shapes 4 --val 1 --epochs 1 --out sheets",
        "epoch_001.png is not a recorded result",
    ),
    ("train --quick --quiet --data . --out .", "images.npz"),
    ("evaluate --checkpoint checkpoint.bin --data .", "not a checkpoint"),
    ("predict softness.json --checkpoint checkpoint.bin --out checkpoint.bin", "checkpoint.bin"),
    ("predict mesh.obj --out mesh.obj", "mesh.obj is an input of this run"),
    (
        "predict softness.json --checkpoint mesh.obj --out mesh.obj",
        "mesh.obj is an input of this run",
    ),
    ("predict softness.json --out notes.txt", "notes.txt"),
    (
        "compare --quick --quiet --methods softness.json --data . --out compared",
        "compare.md is not a recorded result",
    ),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    RECONSTRUCT.keeps_inputs(LINES);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    RECONSTRUCT.every_flag_is_in(&["train", "evaluate", "predict", "compare"], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    let line =
        "train --quick --pairs 2 --steps 1 --epochs 1 --shapes 4 --val 1 --json --out IN/out";
    RECONSTRUCT.prints_no_control_codes(&[
        line,
        "predict IN/mesh.obj --checkpoint IN/none-mesh.obj --out IN/out.obj",
        "evaluate --checkpoint IN/none-mesh.obj",
    ]);
}
