//! The whole program on small scenes: its results and its errors.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod runs;

use std::fs;

use image::{GrayImage, Luma};
use serde_json::Value;

use runs::{PROGRAM, assert_finite, run, run_in, warnings};

/// Runs on a picture of 8 × 8 pixels with these levels.
fn with_target(level: impl Fn(u32, u32) -> u8, line: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("target.png");
    GrayImage::from_fn(8, 8, |x, y| Luma([level(x, y)])).save(&path).unwrap();
    run(&format!("{line} --target {}", path.display())).unwrap()
}

#[test]
fn a_few_steps_lower_all_errors_and_write_every_file() {
    let out = tempfile::tempdir().unwrap();
    let line = "--size 48 --triangles 150 --steps 60 --scale 0.02 --learning-rate 0.02";
    let json = run_in(out.path(), line).unwrap();
    let [image, parameter] = [&json["image_error"], &json["parameter_error"]];
    for error in [image, &image["hard"], parameter] {
        let of = |key: &str| error[key].as_f64().unwrap();
        assert!(of("final") < 0.5 * of("initial"), "{json}");
    }
    for file in ["result.json", "curve.csv", "before_after.png", "animation.gif", "report.html"] {
        assert!(out.path().join(file).exists(), "{file}");
    }
}

#[test]
fn variants_have_the_triangles_of_the_paper_and_seeds_start_apart() {
    for (line, triangles) in [("", 800), ("--variant transfer", 4000), ("--triangles 7", 7)] {
        let json = run(&format!("evaluate --runs 2 --size 8 --steps 1 {line}")).unwrap();
        assert_eq!(json["faces"], triangles);
        let errors = json["image_error"]["per_run"].as_array().unwrap();
        assert_ne!(errors[0], errors[1]);
    }
}

#[test]
fn a_run_does_not_depend_on_those_before_it() {
    let line = "--size 16 --triangles 40 --steps 3";
    let many = run(&format!("evaluate --runs 3 {line}")).unwrap();
    let alone = run(&format!("solve --seed 2 {line}")).unwrap();
    assert_eq!(many["image_error"]["per_run"][2], alone["image_error"]["final"]);
}

#[test]
fn empty_full_and_gray_targets_end_with_finite_numbers() {
    let line = "--size 8 --triangles 20 --steps 20 --learning-rate 0.1";
    let empty = with_target(|_, _| 0, line);
    assert!(warnings(&empty).contains("nothing white"), "{empty}");
    let full = with_target(|_, _| 255, line);
    assert!(warnings(&full).contains("nothing black"), "{full}");
    let gray = with_target(|_, _| 100, line);
    let dot = with_target(|x, y| if (x, y) == (2, 5) { 255 } else { 0 }, line);
    let missed = with_target(
        |x, y| if (x, y) == (2, 5) { 255 } else { 0 },
        "--size 64 --triangles 1 --steps 2 --scale 1e-4",
    );
    assert!(warnings(&missed).contains("no nearer to the target"), "{missed}");
    for json in [empty, full, gray, dot, missed] {
        assert_finite(&json);
    }
}

#[test]
fn one_pixel_and_one_triangle_end_with_finite_numbers() {
    let pixel = run("--size 1 --steps 5").unwrap();
    assert_finite(&pixel);
    assert!(warnings(&pixel).contains("nothing white"), "{pixel}");
    assert_finite(&run("--triangles 1 --size 16 --steps 20 --learning-rate 0.1").unwrap());
}

#[test]
fn every_named_softness_ends_with_finite_numbers_at_any_scale() {
    for name in ["logistic", "gauss", "exp", "gamma", "mlp"] {
        for scale in ["1e-6", "1e-2", "10"] {
            let line = format!("--softness {name} --scale {scale} --size 8 --steps 2");
            assert_finite(&run(&format!("{line} --triangles 30")).unwrap());
        }
    }
    assert_finite(&run("--squared --schedule decay --size 8 --steps 3").unwrap());
}

#[test]
fn contradictions_are_usage_errors_and_bad_files_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("text.png");
    fs::write(&text, "no picture").unwrap();
    let no_picture = format!("--target {}", text.display());
    for (line, code, part) in [
        ("--triangles 0", 2, "from 1 to 100000"),
        ("--softness missing.json --scale 0.1", 2, "holds its own parameters"),
        ("--softness missing.json", 1, "missing.json"),
        ("--target missing.png", 1, "cannot read the picture missing.png"),
        (&no_picture, 1, "no picture that can be read"),
    ] {
        let failure = run(line).unwrap_err();
        assert_eq!(failure.code, code, "{line}: {failure}");
        assert!(failure.message.contains(part), "{line}: {failure}");
    }
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    for line in [
        "--size 16 --triangles 20 --steps 2",
        "evaluate --runs 3 --size 16 --triangles 20 --steps 2",
    ] {
        let out = tempfile::tempdir().unwrap();
        PROGRAM.on_one_thread().run_in(out.path(), line).unwrap();
    }
}
