//! The whole program in colour.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod runs;

use std::fs;

use image::{Rgba, RgbaImage};
use serde_json::Value;

use runs::{assert_finite, run, run_in, warnings};

/// Runs on a picture of 8 × 8 pixels with these colours.
fn in_colour(colour: impl Fn(u32, u32) -> [u8; 4], line: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("target.png");
    RgbaImage::from_fn(8, 8, |x, y| Rgba(colour(x, y))).save(&path).unwrap();
    run(&format!("{line} --colour --target {}", path.display())).unwrap()
}

fn assert_finite_in_colour(json: &Value) {
    assert_finite(json);
    for of in ["hard", "soft"] {
        for key in ["initial", "final", "best"] {
            assert!(
                json["psnr"][of][key].as_f64().is_some_and(f64::is_finite),
                "{of} {key}: {json}"
            );
        }
    }
}

#[test]
fn a_few_steps_come_nearer_to_our_landscape_and_write_every_file() {
    let out = tempfile::tempdir().unwrap();
    let line = "--colour --size 48 --triangles 150 --steps 60 --scale 0.01 --scale-end 0.001 --learning-rate 0.006";
    let json = run_in(out.path(), line).unwrap();
    let of = |of: &str, key: &str| json["psnr"][of][key].as_f64().unwrap();
    assert!(of("hard", "final") > of("hard", "initial") + 1.0, "{json}");
    assert!(of("hard", "final") > 24.0 && of("hard", "best") >= of("hard", "final"), "{json}");
    assert_eq!(
        (json["faces"].as_u64(), json["task"].as_str()),
        (Some(150), Some("shape2d-colour"))
    );
    let files = ["result.json", "before_after.png", "animation.gif", "report.html", "result.svg"];
    for file in files {
        assert!(out.path().join(file).exists(), "{file}");
    }
    let svg = fs::read_to_string(out.path().join("result.svg")).unwrap();
    assert_eq!(svg.matches("<polygon").count(), 150);
    let picture = image::open(out.path().join("before_after.png")).unwrap().into_rgb8();
    assert!(picture.pixels().any(|p| p.0[0] != p.0[1]), "the pictures have no colours");
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(
        page.contains("-p shape2d -- --colour") || page.contains("-p shape2d -- solve --colour")
    );
    // A black-and-white run in the same folder removes the drawing.
    run_in(out.path(), "--size 8 --triangles 5 --steps 1").unwrap();
    assert!(!out.path().join("result.svg").exists());
}

#[test]
fn a_wide_picture_keeps_its_proportions() {
    let (folder, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = folder.path().join("wide.png");
    let colour = |x: u32, y: u32| Rgba([(8 * x) as u8, (16 * y) as u8, 90, 255]);
    RgbaImage::from_fn(30, 12, colour).save(&path).unwrap();
    let line = format!("--size 24 --triangles 40 --steps 20 --target {}", path.display());
    let json = run_in(out.path(), &format!("--colour {line}")).unwrap();
    let of = |key: &str| json["psnr"]["hard"][key].as_f64().unwrap();
    assert!(of("initial") > 20.0 && of("best") > of("initial"), "{json}");
    assert_eq!(json["settings"]["image_size"], "60 x 24", "{json}");
    let svg = fs::read_to_string(out.path().join("result.svg")).unwrap();
    assert!(svg.contains("viewBox=\"0 0 60 24\""), "{svg}");
    // Four pictures in a row, with gaps.
    let picture = image::open(out.path().join("before_after.png")).unwrap();
    let ratio = f64::from(picture.width()) / f64::from(picture.height());
    assert!((ratio - 10.0).abs() < 0.5, "{ratio}");
    assert_finite(&run_in(out.path(), &format!("{line} --resolution 6 --scale 0.1")).unwrap());
    let wrong = run_in(out.path(), &format!("{line} --resolution 3 --scale 0.1")).unwrap_err();
    assert!(wrong.to_string().contains("one of 24, 12, 6"), "{wrong}");
}

#[test]
fn pictures_may_be_tall_but_neither_thin_nor_huge() {
    let folder = tempfile::tempdir().unwrap();
    let line = |name: &str, width: u32, height: u32, more: &str| {
        let path = folder.path().join(name);
        RgbaImage::from_pixel(width, height, Rgba([200, 90, 20, 255])).save(&path).unwrap();
        format!("--colour --triangles 9 --steps 2 {more} --target {}", path.display())
    };
    let out = tempfile::tempdir().unwrap();
    run_in(out.path(), &line("tall.png", 3, 4, "--size 8")).unwrap();
    let svg = fs::read_to_string(out.path().join("result.svg")).unwrap();
    assert!(svg.contains("viewBox=\"0 0 8 11\""), "{svg}");
    let thin = run(&line("thin.png", 1, 40, "--size 8")).unwrap_err().to_string();
    assert!(thin.contains("thin.png: a picture of 1 x 40 pixels is too thin"), "{thin}");
    let huge = run(&line("huge.png", 1, 16, "--size 4096")).unwrap_err().to_string();
    assert!(huge.contains("--size 4096 draws 4096 x 65536 pixels"), "{huge}");
}

#[test]
fn pictures_without_a_shape_end_with_finite_numbers_and_a_warning() {
    for colour in [[0, 0, 0, 255], [255; 4], [90, 20, 200, 255], [255, 0, 0, 0]] {
        let json = in_colour(|_, _| colour, "--size 8 --triangles 20 --steps 20");
        assert!(warnings(&json).contains("one colour"), "{json}");
        assert_finite_in_colour(&json);
    }
}

#[test]
fn few_triangles_pixels_and_wild_softness_end_with_finite_numbers() {
    let picture = |x: u32, y: u32| [(30 * x) as u8, (20 * y) as u8, 255 - (30 * x) as u8, 255];
    let rest = ["--schedule static", "--resolution auto --scale 0.5 --scale-end 0.01"];
    let wild = ["logistic", "gauss", "exp", "gamma", "mlp", "uniform"]
        .map(|name| format!("--softness {name}"));
    let scales = ["1e-6", "10"].map(|scale| format!("--scale {scale} --learning-rate 1"));
    let few =
        ["--triangles 1", "--triangles 2", "--triangles 3 --size 1", "--triangles 40 --size 3"];
    let of_30 = rest.map(str::to_owned).into_iter().chain(wild).chain(scales);
    let of_30 = of_30.map(|line| format!("--triangles 30 --size 8 {line}"));
    for line in few.map(str::to_owned).into_iter().chain(of_30) {
        assert_finite_in_colour(&in_colour(picture, &format!("--steps 8 {line}")));
    }
}

#[test]
fn contradictions_are_usage_errors_and_bad_files_are_not() {
    for (line, code, part) in [
        ("--colour --surrogate-scale 0.1", 2, "leave out --surrogate-scale"),
        ("--colour --softness learned", 2, "no softness learned is bundled"),
        ("--colour=yes", 2, "--colour"),
        ("--colour --triangles 0", 2, "from 1 to 100000"),
        ("--colour --target missing.png", 1, "cannot read the picture missing.png"),
        ("--target=--colour", 1, "cannot read the picture --colour"),
        ("--target --colour", 2, "a value is required for '--target"),
    ] {
        let failure = run(line).unwrap_err();
        assert_eq!(failure.code, code, "{line}: {failure}");
        assert!(failure.message.contains(part), "{line}: {failure}");
    }
}

#[test]
fn seeds_start_apart_and_a_run_does_not_depend_on_those_before_it() {
    let line = "--colour --size 16 --triangles 40 --steps 3";
    let many = run(&format!("evaluate --runs 3 {line}")).unwrap();
    let alone = run(&format!("solve --seed 2 {line}")).unwrap();
    let errors = &many["image_error"]["per_run"];
    assert_eq!(errors[2], alone["image_error"]["final"]);
    assert_ne!(errors[0], errors[1]);
}
