//! Poses from masks with unknown focal length, and the page of one.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

use serde_json::{Value, json};
use softrast_test_kit::Program;

fn fox(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views/fox");
    folder.join(name).to_str().unwrap().to_owned()
}

#[test]
fn an_unknown_focal_length_is_found_to_five_percent_and_the_fit_is_never_worse() {
    let out = tempfile::tempdir().unwrap();
    let solved = |words: &[&str]| {
        let program = Program::new(env!("CARGO_BIN_EXE_pose"));
        program.run_words(out.path(), &[&["solve"], words].concat()).unwrap()
    };
    let truth: Value = serde_json::from_slice(&fs::read(fox("truth.json")).unwrap()).unwrap();
    let of = |camera: &Value| camera["K"][0][0].as_f64().unwrap();
    let target = fox("images/04.png");
    let assumed = solved(&["--target", &target]);
    let found = solved(&["--target", &target, "--optimise-fov"]);
    let iou = |result: &Value| result["iou"].as_f64().unwrap();
    assert!(iou(&found) >= iou(&assumed), "{} after {}", iou(&found), iou(&assumed));
    let ratio = of(&found["camera"]) / of(&truth["views"][4]);
    assert!((ratio - 1.0).abs() < 0.05 && iou(&found) > 0.97, "{ratio}, {found}");
    // It is no worse if the given focal length is right.
    let given = ["--target", &fox("images/03.png"), "--camera", &fox("transforms.json")];
    let (known, found) = (solved(&given), solved(&[&given[..], &["--optimise-fov"]].concat()));
    assert!(found["iou"].as_f64() >= known["iou"].as_f64(), "{found} after {known}");
}

#[test]
fn the_page_has_the_verdict_first_and_the_camera_in_three_forms() {
    let out = tempfile::tempdir().unwrap();
    let (target, camera) = (fox("images/04.png"), fox("transforms.json"));
    let program = Program::new(env!("CARGO_BIN_EXE_pose"));
    let words = ["solve", "--target", &target, "--camera", &camera, "--size", "64"];
    let found = program.run_words(out.path(), &words).unwrap();
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    let verdict = format!("The pose fits the mask (IoU {:.4}).", found["iou"].as_f64().unwrap());
    let (at, viewer) = (page.find(&verdict).unwrap(), page.find("<div class=\"viewer\">").unwrap());
    assert!(at < viewer && page.contains("\"opens\":0"), "the page does not open with the answer");
    let pose: Vec<String> =
        found["camera"]["colmap"].as_array().unwrap().iter().map(Value::to_string).collect();
    let colmap =
        "1 PINHOLE 120 90 130 131 62.5 43\n\n1 ".to_owned() + &pose.join(" ") + " 1 04.png\n";
    assert!(page.contains(&colmap), "COLMAP: {colmap}");
    let quoted = |value: Value| value.to_string().replace('"', "&quot;");
    let matrix = quoted(found["camera"]["transform_matrix"].clone());
    assert!(
        page.contains(&matrix) && page.contains("&quot;fl_x&quot;:130.0"),
        "nerfstudio: {matrix}"
    );
    let k = quoted(json!([[130.0, 0.0, 62.0], [0.0, 131.0, 42.5], [0.0, 0.0, 1.0]]));
    assert!(page.contains(&k), "OpenCV: {k}");
    for file in ["result.json", "overlay.png"] {
        assert!(page.contains(&format!("<a href=\"{file}\">")) && out.path().join(file).exists());
    }
}
