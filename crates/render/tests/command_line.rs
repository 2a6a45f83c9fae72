//! The program as called: what it prints, what it writes, and how it refuses.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path, process::Command};

use serde_json::Value;
use softrast_lab::Failure;
use softrast_mesh::icosphere;
use softrast_softness::{EdgeSoftness, Family, ScheduledSoftness};

fn mesh(folder: &Path) -> String {
    let path = folder.join("sphere.obj");
    icosphere(1).save(&path).expect("the folder can be written");
    path.to_str().expect("a path in ASCII").to_owned()
}

fn run(words: &[&str]) -> Result<String, Failure> {
    let output = Command::new(env!("CARGO_BIN_EXE_render")).args(words).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).expect("all that is printed is UTF-8");
    match output.status.code() {
        Some(0) => Ok(text(output.stdout)),
        code => Err(Failure {
            code: code.unwrap().try_into().unwrap(),
            message: text(output.stderr).trim_end().to_owned(),
        }),
    }
}

fn json(words: &[&str]) -> Value {
    let printed = run(words).expect("the command line is right");
    let last = printed.lines().last().expect("something is printed");
    serde_json::from_str(last).expect("the last line is JSON")
}

#[test]
fn the_fused_op_gives_the_numbers_of_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, out) = (mesh(folder.path()), folder.path().join("a/sphere.png"));
    let words = "--size 24 --azimuths 0,50,100 --scale 0.02 --target disk:0.1,-0.05,0.4 --json";
    let words: Vec<&str> = words.split(' ').collect();
    let words = [&[&mesh, "--out", out.to_str().unwrap()], &words[..]].concat();
    let fused = json(&words);
    let dense = json(&[&words[..], &["--reference"]].concat());
    for (key, bound) in [("mean_alpha", 1e-4), ("loss", 1e-4), ("gradient_norm", 1e-3)] {
        let [a, b] = [&fused, &dense].map(|report| report[key].as_f64().unwrap());
        assert!((a - b).abs() <= bound * b, "{key}: {a} and {b}");
    }
    assert_eq!(dense["pairs"], 24 * 24 * 80 * 3);
    assert!(fused["pairs"].as_u64() <= dense["pairs"].as_u64());
    assert_eq!([&fused["faces"], &fused["views"], &fused["size"]], [80, 3, 24]);
    for key in ["forward_ms", "backward_ms", "total_ms", "profile_knots"] {
        assert!(fused[key].as_f64().unwrap() > 0.0, "{key}");
    }
    let picture = image::open(&out).unwrap();
    assert_eq!(picture.width(), 3 * 24 + 4 * 2, "a contact sheet of three");
    assert_eq!(fs::read_dir(out.parent().unwrap()).unwrap().count(), 1, "nothing else is left");
}

#[test]
fn a_picture_is_its_own_target() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let out = folder.path().join("sphere.png");
    let out = out.to_str().unwrap();
    run(&[&mesh, "--size", "40", "--out", out]).unwrap();
    let report = json(&[&mesh, "--size", "40", "--out", out, "--target", out, "--json"]);
    // The picture has 8 bits.
    assert!(report["loss"].as_f64().unwrap() < 1e-5, "{report}");
}

#[test]
fn a_softness_file_whose_scale_moves_is_drawn_as_at_its_last_step() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let [out, file] = ["sphere.png", "learned.json"].map(|name| folder.path().join(name));
    let decay = ScheduledSoftness::decay(
        EdgeSoftness { family: Family::Logistic, squared: false },
        0.3,
        0.02,
    );
    decay.save(&file).unwrap();
    let words = |softness: [&str; 2]| {
        let common = [&mesh, "--size", "32", "--json", "--out", out.to_str().unwrap()];
        json(&[&common[..], &softness].concat())["mean_alpha"].as_f64().unwrap()
    };
    let [of_file, named] = [["--softness", file.to_str().unwrap()], ["--scale", "0.02"]].map(words);
    assert!((of_file / named - 1.0).abs() < 1e-6, "{of_file}, not {named}");
}

#[test]
fn a_tolerance_that_culls_most_of_what_counts_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let out = folder.path().join("sphere.png");
    let culled = |tolerance: &str| {
        let words = ["--size", "32", "--scale", "0.05", "--json", "--out", out.to_str().unwrap()];
        let words = [&[&mesh, "--tolerance", tolerance], &words[..]].concat();
        json(&words)["culled_by_tolerance"].as_f64().unwrap()
    };
    assert_eq!(culled("1e-5"), 0.0);
    assert_eq!(culled("1e-7"), 0.0);
    assert!(culled("0.9") > 0.5);
}

#[test]
fn bad_input_is_one_line_and_leaves_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let blocked = folder.path().join("sphere.obj/out.png");
    let blocked = blocked.to_str().unwrap();
    let out = folder.path().join("out.png");
    let cases: [(&[&str], u8, &str); 13] = [
        (&["missing.obj"], 1, "missing.obj: cannot be read"),
        (&[&mesh, "--size", "0"], 2, "whole number from 1 to 4096"),
        (&[&mesh, "--scale", "-1"], 2, "expected a positive number"),
        (&[&mesh, "--azimuths", "1,,2"], 2, "with commas between them"),
        (&[&mesh, "--fov", "180"], 2, "between 0 and 180"),
        (&[&mesh, "--tolerance", "1"], 2, "above 0 and below 1"),
        (&[&mesh, "--softness", "soft"], 2, "known are logistic, bilogit, gauss"),
        (&[&mesh, "--softness", "missing.json"], 1, "missing.json"),
        (&[&mesh, "--softness", "a.json", "--squared"], 2, "a file has its own"),
        (&[&mesh, "--t-conorm", "max"], 2, "use probabilistic, einstein"),
        (&[&mesh, "--backend", "cuda"], 2, "expected ndarray, flex or wgpu"),
        (&[&mesh, "--target", &mesh], 1, "cannot read the target"),
        (&[&mesh, "--out", blocked], 1, "choose another with --out"),
    ];
    for (words, code, message) in cases {
        let mut words = words.to_vec();
        if !words.contains(&"--out") {
            words.extend(["--out", out.to_str().unwrap()]);
        }
        let failure = run(&words).unwrap_err();
        let line = failure.to_string();
        assert!(line.contains(message) && !line.contains('\n'), "{words:?}: {line}");
        assert_eq!(failure.code, code, "{line}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "the mesh alone is left");
}
