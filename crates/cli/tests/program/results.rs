//! A whole task behind the shared command line: files, numbers, bad input.

use std::{collections::HashSet, ffi::OsString, fs, io::Cursor, path::Path};

use crate::disc::Disc;
use image::AnimationDecoder;
use serde_json::Value;
use softrast_cli::execute;
use softrast_lab::Failure;
use tempfile::TempDir;

/// The first file is the list of the others.
const FILES: [&str; 6] = [
    ".softrast.json",
    "animation.gif",
    "before_after.png",
    "curve.csv",
    "report.html",
    "result.json",
];

/// Runs the task with the words of a line, results in `out`, and gives its standard output.
fn run_in(out: &Path, line: &str) -> Result<String, Failure> {
    let words = ["disc"].into_iter().chain(line.split_whitespace());
    let mut words: Vec<OsString> = words.map(OsString::from).collect();
    words.extend([OsString::from("--out"), out.into()]);
    let mut stdout = Vec::new();
    execute::<Disc>(words, &mut stdout)?;
    Ok(String::from_utf8(stdout).unwrap())
}

/// A solved line: its folder and the JSON object of its last line.
fn solved(line: &str) -> (TempDir, Value) {
    let out = tempfile::tempdir().unwrap();
    let stdout = run_in(out.path(), &format!("{line} --quiet --json")).unwrap();
    let json = serde_json::from_str(stdout.lines().last().unwrap()).unwrap();
    (out, json)
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn solve_is_the_default_and_writes_every_file() {
    let (out, json) = solved("");
    assert_eq!(names(out.path()), FILES);
    let file: Value =
        serde_json::from_slice(&fs::read(out.path().join("result.json")).unwrap()).unwrap();
    assert_eq!(file, json);
    assert_eq!((&json["task"], &json["command"]), (&"disc".into(), &"solve".into()));
    for key in ["variant", "softness", "backend", "out", "success_means"] {
        assert!(json[key].is_string(), "{key}");
    }
    for key in ["parameters", "seed", "runs", "steps", "size", "faces", "success_rate"] {
        assert!(json[key].is_number(), "{key}");
    }
    assert!(json["peak_memory_mib"].is_number() || !cfg!(target_os = "linux"));
    for key in ["total", "step_median", "per_run"] {
        assert!(json["seconds"][key].is_number(), "{key}");
    }
    for error in [&json["image_error"], &json["parameter_error"], &json["image_error"]["hard"]] {
        let [initial, last, best] =
            ["initial", "final", "best"].map(|k| error[k].as_f64().unwrap());
        assert!(best <= last && last < initial, "{initial} {last} {best}");
        assert!(error.get("ci95").is_none() && error.get("per_run").is_none());
    }
    assert_eq!(json["settings"]["learning_rate"], 0.02);
}

#[test]
fn evaluate_adds_intervals_and_the_value_of_every_run() {
    let (_out, json) = solved("evaluate --runs 6 --seed 3");
    assert_eq!((&json["runs"], &json["seed"]), (&6.into(), &3.into()));
    for error in [&json["image_error"], &json["parameter_error"], &json["image_error"]["hard"]] {
        let per_run: Vec<f64> =
            error["per_run"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        let mean = per_run.iter().sum::<f64>() / 6.0;
        let [low, high] = [0, 1].map(|k| error["ci95"][k].as_f64().unwrap());
        assert_eq!(per_run.len(), 6);
        assert!((error["final"].as_f64().unwrap() - mean).abs() < 1e-12);
        assert!(low < mean && mean < high, "{low} {mean} {high}");
    }
    let [low, high] = [0, 1].map(|k| json["success_ci95"][k].as_f64().unwrap());
    let rate = json["success_rate"].as_f64().unwrap();
    assert!((low..=high).contains(&rate), "{low} {rate} {high}");
}

#[test]
fn the_same_seed_gives_the_same_numbers_in_any_batch() {
    let read = |out: &TempDir| fs::read_to_string(out.path().join("curve.csv")).unwrap();
    let (first, json) = solved("evaluate --runs 5");
    let (again, json_again) = solved("evaluate --runs 5");
    assert_eq!(read(&first), read(&again));
    assert_eq!(json["image_error"], json_again["image_error"]);

    let (alone, _) = solved("--seed 4");
    let rows = read(&first);
    let of_seed_4: Vec<&str> = rows.lines().filter(|row| row.starts_with("4,")).collect();
    assert_eq!(read(&alone).lines().skip(1).collect::<Vec<_>>(), of_seed_4);
}

#[test]
fn the_curve_has_a_row_for_every_seed_and_step() {
    let (out, json) = solved("evaluate --runs 3 --steps 7");
    let text = fs::read_to_string(out.path().join("curve.csv")).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let expected = "seed,step,loss,image_error,parameter_error,scale,image_error_hard";
    assert_eq!(header, expected);
    let rows: Vec<Vec<f64>> =
        rows.lines().map(|row| row.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 3 * 8);
    assert!(rows.iter().all(|row| row.len() == 7));
    let ends: Vec<f64> = rows.iter().filter(|row| row[1] == 7.0).map(|row| row[3]).collect();
    assert_eq!(Value::from(ends), json["image_error"]["per_run"]);
}

#[test]
fn pictures_decode_and_small_ones_are_enlarged() {
    let (out, _) = solved("--size 10 --steps 300");
    let sheet = image::open(out.path().join("before_after.png")).unwrap();
    assert!(sheet.width() > 4 * 256 && sheet.height() > 256);

    let gif = fs::read(out.path().join("animation.gif")).unwrap();
    let frames = image::codecs::gif::GifDecoder::new(Cursor::new(gif)).unwrap().into_frames();
    assert_eq!(frames.collect_frames().unwrap().len(), 80);
}

#[test]
fn the_report_needs_no_other_file() {
    let (out, _) = solved("evaluate --runs 3");
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    for part in ["<svg", "data:image/png;base64,", "data:image/gif;base64,", "distance"] {
        assert!(page.contains(part), "{part}");
    }
    let sources: HashSet<&str> =
        page.match_indices("src=\"").map(|(at, _)| &page[at + 5..at + 16]).collect();
    assert_eq!(sources, HashSet::from(["data:image/"]));
    assert!(!page.contains("<script") && !page.contains("<link"));
}

#[test]
fn one_step_and_one_pixel_are_enough() {
    let (out, json) = solved("--steps 1 --size 1");
    assert_eq!(names(out.path()), FILES);
    assert_eq!((&json["steps"], &json["size"]), (&1.into(), &1.into()));
}

#[test]
fn without_json_a_person_gets_a_short_summary() {
    let out = tempfile::tempdir().unwrap();
    let text = run_in(out.path(), "--variant transfer").unwrap();
    assert!((4..12).contains(&text.lines().count()), "{text}");
    for part in ["disc (transfer): logistic", "hard MSE", "radii", "yes", "report.html"] {
        assert!(text.contains(part), "{part} in {text}");
    }
}

#[test]
fn numbers_that_blow_up_end_the_results_before() {
    let (out, json) = solved("--learning-rate 1e39 --steps 100");
    assert_eq!((&json["success_rate"], &json["steps"]), (&0.0.into(), &100.into()));
    assert!(json["parameter_error"]["final"].is_number());
    assert!(json["warnings"][0].as_str().unwrap().contains("stop being finite at step 1"));
    let rows = fs::read_to_string(out.path().join("curve.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 1);
}

#[test]
fn bad_input_gives_one_line_and_leaves_nothing_behind() {
    let cases = [
        ("frobnicate", 2, "unexpected argument 'frobnicate'"),
        ("--softness sofft", 2, "one of logistic, bilogit, gauss"),
        ("--softness learned", 2, "no softness learned is bundled for disc"),
        ("--softness none.json", 1, "cannot read softness"),
        ("--variant both", 2, "[possible values: original, transfer]"),
        ("--schedule static --scale-end 0.1", 2, "--schedule decay"),
        ("--scale 0", 2, "positive"),
        ("--scale -0.1", 2, "positive"),
        ("--scale inf", 2, "positive"),
        ("--learning-rate NaN", 2, "positive"),
        ("--tolerance 1", 2, "above 0 and below 1"),
        ("--size 0", 2, "from 1 to 4096"),
        ("--steps 0", 2, "from 1"),
        ("--steps 1.5", 2, "from 1"),
        ("evaluate --runs 0", 2, "from 1"),
        ("--runs 2", 2, "evaluate"),
        ("--seed -1", 2, "from 0"),
        ("--no-such-flag", 2, "unexpected argument"),
        ("--steps", 2, "--steps"),
        ("--radius", 2, "--radius"),
        ("--resume", 2, "--resume goes with evaluate, search, choose, learn (see --help)"),
        ("--baseline logistic", 2, "--baseline goes with evaluate"),
        ("evaluate --search-runs 3", 2, "--search-runs goes with search, choose"),
        ("search --baseline logistic", 2, "--baseline goes with evaluate"),
        ("evaluate --baseline sofft", 2, "one of logistic, bilogit, gauss"),
        ("evaluate --baseline learned", 2, "--baseline: no softness learned is bundled"),
        ("evaluate --scales 1,2", 2, "--scales goes with search"),
        ("search --scales 0.1,0", 2, "positive"),
        ("search --search-runs 0", 2, "from 1"),
        (
            "search --schedule static --scale 1 --learning-rate 1 --surrogate-scale 2",
            2,
            "nothing to choose from",
        ),
        ("search --no-surrogate --surrogate-scale 2", 2, "cannot be used with"),
        ("--rate-end 1.1", 2, "above 0 and at most 1"),
        ("search --seed 999999", 2, "seeds 1000000 to 1000007"),
        ("search --softness auto", 2, "--softness auto goes with solve and evaluate"),
        ("learn --softness auto", 2, "--softness auto goes with solve and evaluate"),
        ("evaluate --baseline auto", 2, "--baseline: --softness auto goes with"),
        ("learn --backend flex", 2, "learn is compiled for ndarray alone"),
        (
            "learn --outer-loss soft",
            2,
            "expected one of `fixed`, `pixels`, `hard`, `returned`, `own`",
        ),
        ("learn --inner 3", 2, "unexpected argument '--inner'"),
    ];
    let root = tempfile::tempdir().unwrap();
    for (line, code, says) in cases {
        let failure = run_in(&root.path().join("out"), line).unwrap_err();
        assert_eq!(failure.code, code, "{line}: {failure}");
        assert!(failure.message.contains(says), "{line}: {failure}");
        assert_eq!(failure.to_string().lines().count(), 1, "{line}: {failure}");
        assert_eq!(failure.message.contains("(see --help)"), code == 2, "{line}: {failure}");
    }
    assert!(names(root.path()).is_empty());
}

#[test]
fn a_folder_that_cannot_be_written_is_told_before_the_work() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("file"), "").unwrap();
    // These many steps would take hours.
    let line = "evaluate --runs 1000000 --steps 1000000";
    let failure = run_in(&root.path().join("file/out"), line).unwrap_err();
    assert_eq!(failure.code, 1);
    assert!(failure.message.contains("--out"), "{failure}");
    assert_eq!(names(root.path()), ["file"]);
}

#[test]
fn numbers_that_start_out_wrong_are_an_error_and_leave_nothing() {
    let root = tempfile::tempdir().unwrap();
    let failure = run_in(&root.path().join("out"), "--radius nan").unwrap_err();
    assert_eq!(failure.code, 1);
    assert!(failure.message.contains("before the first step"), "{failure}");
    assert!(names(root.path()).is_empty());
}

#[test]
fn help_goes_to_the_standard_output() {
    let out = tempfile::tempdir().unwrap();
    for (line, parts) in [
        ("--help", ["solve", "evaluate", "search", "choose", "learn"]),
        ("solve --help", ["--softness", "--scale", "--radius", "--steps", "--json"]),
        ("evaluate --help", ["--runs", "--baseline", "--resume", "--radius", "--softness"]),
    ] {
        let help = run_in(out.path(), line).unwrap();
        for part in parts {
            assert!(help.contains(part), "{line}: {part}");
        }
    }
    assert!(!run_in(out.path(), "solve --help").unwrap().contains("--resume"));
    assert!(names(out.path()).is_empty());
}
