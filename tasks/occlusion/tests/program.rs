//! The whole program on small scenes: its results and its errors.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

use serde_json::Value;
use softrast_inverse::DepthSoftnessFile;
use softrast_softness::{DepthSoftness, Family};
use softrast_test_kit::{Failure, Program, assert_finite, warnings};

const PROGRAM: Program = Program::new(env!("CARGO_BIN_EXE_occlusion"));

/// Runs a command line with results in `out`, and returns its JSON line.
fn run_in(out: &Path, line: &str) -> Result<Value, Failure> {
    PROGRAM.run_in(out, line)
}

fn run(line: &str) -> Result<Value, Failure> {
    run_in(tempfile::tempdir().unwrap().path(), line)
}

#[test]
fn the_defaults_find_the_order_and_write_every_file() {
    let out = tempfile::tempdir().unwrap();
    let json = run_in(out.path(), "").unwrap();
    assert_eq!(json["success_rate"], 1.0, "{json}");
    assert_eq!(json["parameter_error"]["final"], 0.0);
    assert_eq!(json["image_error"]["hard"]["final"], 0.0);
    assert!(json["parameter_error"]["initial"].as_f64().unwrap() > 0.0);
    for key in ["front", "depth"] {
        assert!(json["parameter_error"][key]["final"].is_number());
    }
    assert_eq!(warnings(&json), "[]");
    for file in ["result.json", "curve.csv", "before_after.png", "animation.gif", "report.html"] {
        assert!(out.path().join(file).exists(), "{file}");
    }
}

#[test]
fn most_seeds_of_both_variants_succeed() {
    for (variant, least) in [("original", 0.9), ("transfer", 0.9)] {
        let line = format!("evaluate --runs 20 --size 24 --seed 500 --variant {variant}");
        let rate = run(&line).unwrap()["success_rate"].as_f64().unwrap();
        assert!(rate >= least, "{variant}: {rate}");
    }
}

#[test]
fn a_run_does_not_depend_on_its_batch() {
    let line = "--size 16 --steps 5";
    let many = run(&format!("evaluate --runs 3 {line}")).unwrap();
    let alone = run(&format!("solve --seed 2 {line}")).unwrap();
    let [many, alone] = [
        &many["parameter_error"]["depth"]["per_run"][2],
        &alone["parameter_error"]["depth"]["final"],
    ]
    .map(|depth| depth.as_f64().unwrap());
    assert!((many - alone).abs() < 1e-6, "{many} {alone}");
}

#[test]
fn the_depth_softness_is_that_of_the_edges_unless_named() {
    let softness = |line: &str| {
        let json = run(&format!("--size 8 --steps 2 {line}")).unwrap();
        let depth = json["settings"]["depth_softness"].as_str().unwrap().to_owned();
        (json["softness"].as_str().unwrap().to_owned(), depth, json["parameters"].as_u64().unwrap())
    };
    let named = |softness: &str, depth: &str, n| (softness.to_owned(), depth.to_owned(), n);
    assert_eq!(softness("--softness learned"), named("learned", "learned", 4));
    assert_eq!(softness(""), named("preset", "preset", 2));
    assert_eq!(softness("--softness logistic"), named("logistic", "logistic", 2));
    assert_eq!(softness("--softness exp"), named("exp", "exp", 5));
    let mlp = named("mlp edges and depth_mlp depths", "depth_mlp", 112);
    assert_eq!(softness("--softness mlp"), mlp);
    let gauss = named("logistic edges and gauss depths", "gauss", 2);
    assert_eq!(softness("--softness logistic --depth-softness gauss"), gauss);
}

#[test]
fn a_depth_softness_file_is_used_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("depth.json");
    let depth_softness = DepthSoftness::Family(Family::Exp);
    let phi = depth_softness.default_phi(0.2);
    DepthSoftnessFile { depth_softness, phi, note: None }.save(&path).unwrap();
    let line = |depth: &str| format!("--size 12 --steps 8 --depth-softness {depth}");
    let [file, named] = [path.display().to_string(), "exp --depth-scale 0.2".into()]
        .map(|depth| run(&line(&depth)).unwrap()["image_error"]["final"].clone());
    assert_eq!(file, named);
}

#[test]
fn every_depth_softness_ends_with_finite_numbers_at_any_scale() {
    for family in Family::ALL {
        for scale in ["1e-6", "1e6"] {
            let line =
                format!("--depth-softness {family} --depth-scale {scale} --size 8 --steps 3");
            assert_finite(&run(&line).unwrap());
        }
    }
    for name in ["logistic", "gauss", "exp", "gamma", "mlp"] {
        for scale in ["1e-6", "1e-2", "10"] {
            assert_finite(
                &run(&format!("--softness {name} --scale {scale} --size 8 --steps 3")).unwrap(),
            );
        }
    }
    assert_finite(&run("--squared --schedule decay --size 8 --steps 3").unwrap());
}

#[test]
fn a_softness_that_tells_no_depths_apart_is_said_to_be_so() {
    let json = run("--depth-scale 1e6 --size 16 --steps 3").unwrap();
    assert!(warnings(&json).contains("weighs all depths alike"), "{json}");
    let json = run("--depth-softness uniform --depth-scale 1e-6 --size 16 --steps 3").unwrap();
    assert!(warnings(&json).contains("no quad moved"), "{json}");
}

#[test]
fn a_search_chooses_the_width_of_the_soft_depth_unless_it_is_named() {
    let line = "search --size 8 --steps 2 --runs 1 --search-runs 1 --schedule static --scale 1e-3 \
                --learning-rates 0.03,0.3 --loops 12";
    let searched = |more: &str| run(&format!("{line} {more}")).unwrap()["search"].clone();
    let free = searched("");
    assert!(free["best"]["flags"].as_str().unwrap().contains("--depth-scale"), "{free}");
    assert_eq!(free["trials"].as_array().unwrap().len(), 12);
    let named = searched("--depth-scale 0.2");
    assert!(!named["best"]["flags"].as_str().unwrap().contains("--depth-scale"), "{named}");
}

#[test]
fn where_any_softness_finds_the_order_a_logistic_is_chosen() {
    let line = "choose --size 24 --search-runs 3";
    let chosen = run(line).unwrap();
    assert_eq!(chosen["flags"], "--softness logistic --schedule static", "{chosen}");
    // There is neither an image to draw at lower resolution nor a mesh.
    assert_eq!(chosen["choice"]["stages"].as_array().unwrap().len(), 1);
}

#[test]
fn one_pixel_ends_with_finite_numbers_and_a_warning() {
    for variant in ["original", "transfer"] {
        assert_finite(&run(&format!("--size 1 --steps 5 --variant {variant}")).unwrap());
    }
    let json = run("--size 1 --steps 5").unwrap();
    assert!(warnings(&json).contains("does not show the order of 2 of 3 pairs"), "{json}");
}

#[test]
fn contradictions_are_usage_errors_and_broken_files_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let huge = folder.path().join("huge.json");
    let phi = vec![1e30; 56];
    let text = serde_json::json!({"depth_softness": "depth_mlp", "phi": phi}).to_string();
    fs::write(&huge, text).unwrap();
    let huge = format!("--depth-softness {}", huge.display());
    for (line, code, part) in [
        ("--depth-softness deep", 2, "unknown depth softness"),
        ("--depth-softness depth_mlp --depth-scale 0.1", 2, "depth_mlp has no scale"),
        ("--depth-softness missing.json --depth-scale 0.1", 2, "holds its own parameters"),
        ("--depth-softness missing.json", 1, "missing.json"),
        ("--surrogate-scale 0.1", 2, "stay where they are"),
        ("--softness learned --scale 0.1", 2, "holds its own parameters"),
        ("--depth-scale inf", 2, "positive number"),
        ("--depth-scale NaN", 2, "positive number"),
        ("--resolution auto", 2, "leave out --resolution"),
        ("--tolerance 1e-3", 2, "leave out --tolerance"),
        (&huge, 1, "not finite"),
    ] {
        let failure = run(line).unwrap_err();
        assert_eq!(failure.code, code, "{line}: {failure}");
        assert!(failure.message.contains(part), "{line}: {failure}");
    }
}

#[test]
fn a_file_with_a_surrogate_does_what_it_does_without() {
    let folder = tempfile::tempdir().unwrap();
    let solved = |rest: &str| {
        let path = folder.path().join("softness.json");
        let softness = r#"{"family": "gauss", "squared": false}"#;
        let text = format!(r#"{{"softness": {softness}, "phi": [-6.5]{rest}}}"#);
        fs::write(&path, text).unwrap();
        run(&format!("--size 8 --steps 3 --softness {}", path.display())).unwrap()
    };
    let surrogate =
        r#", "surrogate": {"softness": {"family": "gauss", "squared": false}, "phi": [-5]}"#;
    let [plain, both] = ["", surrogate].map(solved);
    assert_eq!(plain["image_error"], both["image_error"]);
    assert_eq!(plain["parameters"], both["parameters"]);
}

/// A few outer steps on small scenes.
const LEARN: &str = "learn --updates 3 --steps 6 --batch 2 --validation-runs 2 --size 10";

#[test]
fn a_learned_softness_is_one_that_the_task_accepts() {
    for flags in [
        "--estimator unrolled",
        "--softness mlp --estimator direct",
        "--schedule decay --estimator es --learn-rate",
        "--estimator alternating",
    ] {
        let out = tempfile::tempdir().unwrap();
        let json = run_in(out.path(), &format!("{LEARN} {flags}")).unwrap();
        assert!(json["best"]["validation_loss"].as_f64().is_some_and(f64::is_finite), "{json}");
        assert_eq!(json["instances"], serde_json::json!({ "tried": 6, "dropped": 0 }));
        let lines = fs::read_to_string(out.path().join("learn.jsonl")).unwrap();
        assert_eq!(lines.lines().count(), 4, "one for each outer step and the last validation");
        let page = fs::read_to_string(out.path().join("report.html")).unwrap();
        assert!(page.matches("<svg").count() >= 3 && !page.contains("NaN"), "{flags}");
        let [edge, depth] =
            ["softness.json", "depth_softness.json"].map(|name| out.path().join(name));
        let line = format!(
            "evaluate --runs 2 --size 10 --steps 6 --softness {} --depth-softness {}",
            edge.display(),
            depth.display()
        );
        assert_finite(&run(&line).unwrap());
    }
}

#[test]
fn learning_goes_on_only_from_its_own_checkpoint() {
    let out = tempfile::tempdir().unwrap();
    let whole = run_in(out.path(), LEARN).unwrap();
    let softness = fs::read(out.path().join("softness.json")).unwrap();
    // An incomplete line of a killed program.
    let log = out.path().join("learn.jsonl");
    let lines = fs::read_to_string(&log).unwrap();
    fs::write(&log, format!("{lines}{{\"step\": 9, \"lo")).unwrap();
    let again = run_in(out.path(), &format!("{LEARN} --resume")).unwrap();
    assert_eq!((&again["best"], &again["plan"]), (&whole["best"], &whole["plan"]));
    assert_eq!(fs::read(out.path().join("softness.json")).unwrap(), softness);
    assert_eq!(fs::read_to_string(&log).unwrap(), lines);

    let other = run_in(out.path(), &format!("{LEARN} --resume --outer-rate 0.1")).unwrap_err();
    assert!(other.message.contains("belongs to another job"), "{other}");
    fs::write(out.path().join("learn.checkpoint.json"), "{").unwrap();
    let damaged = run_in(out.path(), &format!("{LEARN} --resume")).unwrap_err();
    assert!(damaged.message.contains("is no checkpoint, or a damaged one"), "{damaged}");
}

#[test]
fn flags_of_learning_that_make_no_sense_are_refused() {
    for (line, part) in [
        ("solve --updates 3", "--updates goes with learn"),
        ("learn --runs 3", "--runs goes with evaluate, search"),
        ("learn --estimator truncated:0", "expected a whole number"),
        ("learn --estimator direct --outer-loss fixed", "leave out --outer-loss"),
        ("learn --outer-loss hard --estimator unrolled", "--outer-loss hard needs --estimator es"),
        ("learn --learn-rate --softness mlp", "--learn-rate needs --estimator es"),
        ("learn --knots 6", "expected a whole number from 1 to 5"),
        ("learn --scales 0.1", "--scales goes with search"),
    ] {
        let failure = run(line).unwrap_err();
        assert_eq!(failure.code, 2, "{line}: {failure}");
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
