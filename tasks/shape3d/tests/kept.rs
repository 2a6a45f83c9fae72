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

const SHAPE3D: Program =
    Program { path: env!("CARGO_BIN_EXE_shape3d"), inputs, short: "--size 8 --steps 1 --quiet" };

fn inputs(folder: &Path) {
    let path = |name: &str| folder.join(name);
    for (name, text) in
        [("mesh.obj", OCTAHEDRON), ("mine.obj", OCTAHEDRON), ("softness.json", SOFTNESS)]
    {
        fs::write(path(name), text).unwrap();
    }
    fs::create_dir_all(path("fox/images")).unwrap();
    fs::create_dir(path("masks")).unwrap();
    fs::create_dir(path("test")).unwrap();
    let fox = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views/fox");
    for k in 0..12 {
        let name = format!("images/{k:02}.png");
        fs::copy(fox.join(&name), path("fox").join(&name)).unwrap();
        fs::copy(fox.join(&name), path(&format!("masks/{k:02}.png"))).unwrap();
    }
    for to in ["fox/views.png", "masks/views.png", "test/views.png"] {
        fs::copy(fox.join("images/00.png"), path(to)).unwrap();
    }
    let cameras = fs::read_to_string(fox.join("transforms.json")).unwrap();
    let cameras = cameras.replace("images/00.png", "views.png");
    fs::write(path("fox/transforms.json"), &cameras).unwrap();
    fs::write(path("test/transforms.json"), cameras.replace("images/", "../fox/images/")).unwrap();
}

const LINES: &[(&str, &str)] = &[
    ("--mesh mesh.obj --template mine.obj --out .", ""),
    ("--softness softness.json --out .", ""),
    ("--views fox --template mine.obj --out new", ""),
    ("--views fox --template mesh.obj --out .", "mesh.obj is an input of this run"),
    ("--views fox --colour --mesh mesh.obj --out .", "mesh.obj is an input of this run"),
    ("--views fox --template mine.obj --out .", "mesh.obj is not a recorded result"),
    ("--views fox --template mine.obj --out fox", "views.png is an input of this run"),
    ("--views fox --hold-out test/transforms.json --template mine.obj --out new", ""),
    (
        "--views fox --hold-out test/transforms.json --template mine.obj --out test",
        "views.png is an input of this run",
    ),
    ("--views fox --masks masks --template mine.obj --out new", ""),
    ("--views fox --normals masks --out new", ""),
    ("--views fox --normals masks --out masks", "views.png is an input of this run"),
    (
        "--views fox --masks masks --template mine.obj --out masks",
        "views.png is an input of this run",
    ),
    ("evaluate --runs 1 --mesh mesh.obj --baseline softness.json --out .", ""),
    (
        "learn --updates 1 --batch 1 --validation-runs 1 --softness softness.json --out .",
        "softness.json is an input of this run",
    ),
];

#[test]
fn no_input_is_removed_replaced_or_shortened() {
    SHAPE3D.keeps_inputs(LINES);
}

#[test]
fn every_flag_that_names_a_file_is_tried() {
    SHAPE3D.every_flag_is_in(&["solve", "evaluate", "search", "choose", "learn"], LINES);
}

#[cfg(unix)]
#[test]
fn names_of_files_reach_no_terminal_as_control_codes() {
    SHAPE3D.prints_no_control_codes(&[
        "--mesh IN/mesh.obj --out IN/out",
        "--mesh IN/mesh.obj --json --out IN/out",
        "--views IN/fox --template IN/mesh.obj --json --out IN/out",
        "--views IN/none-mesh.obj --out IN/out",
        "--mesh IN/none-mesh.obj --out IN/out",
    ]);
}

#[test]
fn results_in_colour_do_not_stay_beside_later_ones_without() {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    let run = |line: &str| {
        let ended = SHAPE3D.run(folder.path(), line);
        assert!(ended.status.success(), "{line}: {ended:?}");
    };
    let there = |name: &str| folder.path().join("out").join(name).exists();
    run("--views fox --template mine.obj --colour --out out");
    let textured = ["textured.glb", "textured.obj", "textured.mtl", "textured.png"];
    assert!(textured.into_iter().chain(["colours.png", "mesh.obj"]).all(there));
    fs::write(folder.path().join("out/notes.txt"), "mine").unwrap();
    run("--views fox --template mine.obj --out out");
    assert!(!there("colours.png") && !textured.into_iter().any(there) && there("mesh.obj"));
    run("--out out");
    assert!(!there("mesh.obj") && there("notes.txt") && there("curve.csv"));
}
