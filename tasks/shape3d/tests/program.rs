//! The whole program on small scenes: its results and its errors.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

use serde_json::Value;
use softrast_test_kit::{Failure, Program, assert_finite, warnings};

const PROGRAM: Program = Program::new(env!("CARGO_BIN_EXE_shape3d"));

/// Runs a command line with results in `out`, and returns its JSON line.
fn run_in(out: &Path, line: &str) -> Result<Value, Failure> {
    PROGRAM.run_in(out, line)
}

fn run(line: &str) -> Result<Value, Failure> {
    run_in(tempfile::tempdir().unwrap().path(), line)
}

/// Runs with a file of this text for `flag`.
fn with_file(flag: &str, text: &str, line: &str) -> Result<Value, Failure> {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("mesh.obj");
    fs::write(&mesh, text).unwrap();
    run(&format!("{line} {flag} {}", mesh.display()))
}

/// A template with few faces.
const OCTAHEDRON: &str = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n\
                          f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

#[test]
fn a_few_steps_lower_all_errors_and_write_every_file() {
    let out = tempfile::tempdir().unwrap();
    let json = run_in(out.path(), "--size 24 --steps 20").unwrap();
    let [image, parameter] = [&json["image_error"], &json["parameter_error"]];
    for error in [image, &image["hard"], parameter] {
        let of = |key: &str| error[key].as_f64().unwrap();
        assert!(of("final") < 0.8 * of("initial"), "{json}");
    }
    for file in ["result.json", "curve.csv", "before_after.png", "animation.gif", "report.html"] {
        assert!(out.path().join(file).exists(), "{file}");
    }
}

#[test]
fn seeds_are_elevations_unless_one_is_named() {
    let json = run("evaluate --size 8 --steps 1").unwrap();
    let starts = |json: &Value| json["image_error"]["per_run"].as_array().unwrap().clone();
    assert_eq!(starts(&json).len(), 5);
    let low = run("solve --elevation -60 --size 8 --steps 1").unwrap();
    let [fifth, low] = [&starts(&json)[4], &low["image_error"]["final"]].map(Value::as_f64);
    assert_eq!(fifth, low);
    let turned = run("evaluate --runs 2 --elevation 0 --size 8 --steps 1").unwrap();
    assert_ne!(starts(&turned)[0], starts(&turned)[1]);
}

#[test]
fn a_coarser_sphere_has_fewer_faces_and_few_pixels_are_judged_on_all() {
    let line = "--size 16 --steps 2 --scale 0.2 --detail 2";
    let full = run(line).unwrap();
    assert_eq!((&full["faces"], &full["settings"]["vertices"]), (&320.into(), &162.into()));
    let fewer = run(&format!("{line} --resolution 8 --tolerance 1e-3")).unwrap();
    assert_eq!((&fewer["size"], &fewer["settings"]["tolerance"]), (&16.into(), &0.001.into()));
    let hard = |json: &Value| json["image_error"]["hard"]["initial"].clone();
    assert_eq!(hard(&full), hard(&fewer));
}

#[test]
fn a_mesh_out_of_view_is_said_to_be_so() {
    let far = "v 0 90 0\nv 1 90 0\nv 0 91 0\nf 1 2 3\n";
    let json = with_file("--mesh", far, "--steps 3 --size 8 --raw").unwrap();
    assert_finite(&json);
    assert!(warnings(&json).contains("24 of 24 target images are empty"), "{json}");
    let json = with_file("--mesh", far, "--steps 3 --size 8").unwrap();
    assert!(!warnings(&json).contains("24 of 24 target images are empty"), "{json}");
}

#[test]
fn a_mesh_that_fills_the_view_is_said_to_do_so() {
    let box_of_cubes = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\n\
                        v -1 1 1\nf 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 4 3 7 8\nf 1 4 8 5\nf 2 3 7 6\n";
    let json = with_file("--mesh", box_of_cubes, "--steps 3 --size 8 --elevation 0 --raw").unwrap();
    assert_finite(&json);
    assert!(warnings(&json).contains("fills 24 of 24 target images"), "{json}");
}

#[test]
fn a_mesh_beyond_the_cameras_ends_with_finite_numbers() {
    let huge = "v -50 -50 0\nv 50 -50 0\nv 0 90 1\nv 0 0 40\nf 1 2 3\nf 1 4 2\nf 2 4 3\n";
    let json = with_file("--mesh", huge, "--steps 3 --size 8 --raw").unwrap();
    assert_finite(&json);
    assert!(warnings(&json).contains("as far as the cameras"), "{json}");
}

#[test]
fn one_pixel_one_face_and_no_area_end_with_finite_numbers() {
    let pixel = run("--size 1 --steps 2").unwrap();
    assert_finite(&pixel);
    assert!(warnings(&pixel).contains("fills 24 of 24 target images"), "{pixel}");
    let face = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let point = "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n";
    for flag in ["--mesh", "--template"] {
        assert_finite(&with_file(flag, face, "--size 16 --steps 3").unwrap());
        assert_finite(&with_file(flag, point, "--size 16 --steps 3").unwrap());
    }
    let json = with_file("--template", point, "--size 16 --steps 3").unwrap();
    assert!(warnings(&json).contains("covers nothing of the target"), "{json}");
}

#[test]
fn every_named_softness_ends_with_finite_numbers_at_any_scale() {
    let check = |line: &str| {
        let line = format!("{line} --size 8 --steps 2");
        assert_finite(&with_file("--template", OCTAHEDRON, &line).unwrap());
    };
    for name in ["logistic", "gauss", "exp", "gamma", "mlp"] {
        for scale in ["1e-6", "1e-2", "10"] {
            check(&format!("--softness {name} --scale {scale}"));
        }
    }
    check("--squared --schedule decay");
}

#[test]
fn contradictions_are_usage_errors_and_missing_files_are_not() {
    for (line, code, part) in [
        ("--elevation 91", 2, "from -90 to 90"),
        ("--elevation nan", 2, "from -90 to 90"),
        ("--softness missing.json --scale 0.1", 2, "holds its own parameters"),
        ("--softness missing.json", 1, "missing.json"),
        ("--mesh missing.obj", 1, "missing.obj"),
        ("--template missing.obj", 1, "missing.obj"),
        ("--template missing.obj --detail 2", 2, "cannot be used with"),
        ("--detail 5", 2, "expected 2, 3 or 4"),
    ] {
        let failure = run(line).unwrap_err();
        assert_eq!(failure.code, code, "{line}: {failure}");
        assert!(failure.message.contains(part), "{line}: {failure}");
    }
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    for line in ["--size 16 --steps 2", "evaluate --runs 3 --size 16 --steps 2"] {
        let out = tempfile::tempdir().unwrap();
        PROGRAM.on_one_thread().run_in(out.path(), line).unwrap();
    }
}
