//! The program does not touch files of others.

#![allow(
    clippy::unwrap_used,
    dead_code,
    reason = "a test may panic, and does not need all that tests share"
)]

#[path = "../../../tests/support/kept.rs"]
mod kept;

use std::{fs, path::Path};

use image::{GrayImage, Luma};
use kept::{OCTAHEDRON, Program, SOFTNESS};

const POSE: Program =
    Program { path: env!("CARGO_BIN_EXE_pose"), inputs, short: "--size 8 --steps 1 --quiet" };

/// Meshes, masks, a camera that is also a start, and a softness, under names of results.
fn inputs(folder: &Path) {
    let path = |name: &str| folder.join(name);
    let camera = r#"{ "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 5], "fx": 20, "fy": 20, "cx": 8, "cy": 8, "width": 16, "height": 16 }"#;
    for (name, text) in
        [("mesh.obj", OCTAHEDRON), ("softness.json", SOFTNESS), ("camera.json", camera)]
    {
        fs::write(path(name), text).unwrap();
    }
    let coloured = |line: &str| {
        if line.starts_with('v') { format!("{line} 0 1 1\n") } else { format!("{line}\n") }
    };
    let coloured: String = OCTAHEDRON.lines().map(coloured).collect();
    fs::write(path("coloured.obj"), coloured).unwrap();
    for folder in ["masks", "given", "made", "found"] {
        fs::create_dir(path(folder)).unwrap();
    }
    let near = |x: u32, y: u32| (i64::from(x) - 8).abs() + (i64::from(y) - 8).abs() < 5;
    let mask = GrayImage::from_fn(16, 16, |x, y| Luma([if near(x, y) { 255 } else { 0 }]));
    for name in [
        "made/overlay.png",
        "overlay-mask.png",
        "mask.png",
        "masks/a.png",
        "masks/a.jpg",
        "masks/a.png.png",
        "given/a.png",
        "given/overlay-a.png",
        "given/overlay.png",
    ] {
        mask.save(path(name)).unwrap();
    }
    fs::write(path("made/result.json"), camera).unwrap();
    fs::write(path("found/result.json"), camera).unwrap();
    fs::write(path("made/mesh.obj"), OCTAHEDRON).unwrap();
}

const LINES: &[(&str, &str)] = &[
    ("--mesh mesh.obj --out .", ""),
    ("--mesh mesh.obj --target overlay-mask.png --out .", ""),
    ("--mesh mesh.obj --target made/overlay.png --out made", "overlay.png is an input of this run"),
    (
        "--mesh ./masks/../mesh.obj --target ./made/overlay.png --out masks/../made",
        "is an input of this run",
    ),
    ("--mesh mesh.obj --targets masks --out .", ""),
    ("--mesh mesh.obj --targets given --out given", "overlay-a.png is an input of this run"),
    (
        "--mesh mesh.obj --target given/overlay.png --masks made --out made",
        "overlay.png is an input of this run",
    ),
    ("--mesh mesh.obj --target mask.png --masks masks --out .", "no mask in masks has its name"),
    ("--mesh mesh.obj --target mask.png --camera camera.json --start camera.json --out .", ""),
    (
        "--mesh mesh.obj --target mask.png --camera found/result.json --out found",
        "result.json is an input of this run",
    ),
    (
        "--mesh mesh.obj --target mask.png --start found/result.json --out found",
        "result.json is an input of this run",
    ),
    ("--mesh made/mesh.obj --out made", "result.json is not a recorded result"),
    ("--colour --mesh coloured.obj --out .", ""),
    ("--softness softness.json --out .", ""),
    ("--softness=found/result.json --out found", "result.json is an input of this run"),
    (
        "evaluate --runs 1 --mesh mesh.obj --softness softness.json --baseline softness.json --out .",
        "",
    ),
    (
        "evaluate --runs 1 --baseline 'found/result.json_--learning-rate_0.1' --out found",
        "result.json",
    ),
    (
        "search --runs 1 --search-runs 1 --loops 2 --mesh mesh.obj --softness softness.json --out .",
        "",
    ),
    ("choose --search-runs 1 --mesh mesh.obj --tolerance 0.01 --resolution 8 --out .", ""),
    ("learn --updates 1 --batch 1 --validation-runs 1 --mesh mesh.obj --out masks", ""),
    (
        "learn --updates 1 --batch 1 --validation-runs 1 --softness softness.json --out .",
        "softness.json is an input of this run",
    ),
    (
        "learn --updates 1 --batch 1 --validation-runs 1 --mesh mesh.obj --out .",
        "softness.json is not a recorded result",
    ),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    POSE.keeps_inputs(LINES);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    POSE.every_flag_is_in(&["solve", "evaluate", "search", "choose", "learn"], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    POSE.prints_no_control_codes(&[
        "--mesh IN/mesh.obj --out IN/out",
        "--mesh IN/mesh.obj --json --out IN/out",
        "evaluate --runs 1 --json --mesh IN/mesh.obj --out IN/out-e",
        "--mesh IN/none-mesh.obj --out IN/out",
        "--target IN/none-mesh.obj --out IN/out",
    ]);
    POSE.prints_no_control_codes(&[
        "--mesh IN/mesh.obj --target IN/mask.png --json --out IN/out",
        "--mesh IN/mesh.obj --target IN/mask.png --out IN/out",
        "--target IN/none-mask.png --out IN/out",
    ]);
}

#[test]
fn results_of_pictures_do_not_stay_beside_those_of_a_seed() {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    let run = |line: &str| assert!(POSE.run(folder.path(), line).status.success(), "{line}");
    run("--mesh mesh.obj --targets masks --out out");
    let overlays = ["overlay-a.png", "overlay-a.jpg.png", "overlay-a.png.png"];
    assert!(overlays.iter().all(|name| folder.path().join("out").join(name).exists()));
    run("--mesh mesh.obj --out out");
    assert!(!overlays.iter().any(|name| folder.path().join("out").join(name).exists()));
}
