//! The program does not touch files of others.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may panic, and does not need all that tests share"
)]

#[path = "../../../tests/support/kept.rs"]
mod kept;

use std::path::Path;

use image::{GrayImage, Luma, Rgb, RgbImage};
use kept::{Program, SOFTNESS};

const SHAPE2D: Program = Program {
    path: env!("CARGO_BIN_EXE_shape2d"),
    inputs,
    short: "--size 8 --triangles 4 --steps 1 --quiet",
};

fn inputs(folder: &Path) {
    let path = |name: &str| folder.join(name);
    std::fs::write(path("softness.json"), SOFTNESS).unwrap();
    std::fs::create_dir(path("work")).unwrap();
    let picture = GrayImage::from_fn(8, 8, |x, _| Luma([if x < 4 { 255 } else { 0 }]));
    for name in ["overlay.png", "target.png", "work/before_after.png"] {
        picture.save(path(name)).unwrap();
    }
    RgbImage::from_fn(8, 8, |x, y| Rgb([30 * x as u8, 30 * y as u8, 9]))
        .save(path("colour.png"))
        .unwrap();
}

const LINES: &[(&str, &str)] = &[
    ("--target overlay.png --out .", ""),
    ("--target work/before_after.png --out work", "before_after.png is an input of this run"),
    ("--target target.png --out work", "before_after.png is not a recorded result"),
    ("--colour --target colour.png --out .", ""),
    (
        "--colour --target=work/before_after.png --out work",
        "before_after.png is an input of this run",
    ),
    ("--softness softness.json --out .", ""),
    ("evaluate --runs 1 --target target.png --baseline softness.json --out .", ""),
    (
        "learn --updates 1 --batch 1 --validation-runs 1 --softness softness.json --out .",
        "softness.json is an input of this run",
    ),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    SHAPE2D.keeps_inputs(LINES);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    SHAPE2D.every_flag_is_in(&["solve", "evaluate", "search", "choose", "learn"], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    SHAPE2D.prints_no_control_codes(&[
        "--target IN/target.png --out IN/out",
        "--json --target IN/target.png --out IN/out",
        "--target IN/none-target.png --out IN/out",
    ]);
}
