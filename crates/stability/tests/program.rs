//! The program's output, files and errors.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{collections::HashSet, ffi::OsString};

use serde_json::Value;
use softrast_test_kit::Program;
use stability::{cases, execute};

#[test]
fn every_case_has_its_own_name() {
    let ids: Vec<&str> = cases().map(|case| case.id).collect();
    assert_eq!(ids.iter().collect::<HashSet<_>>().len(), ids.len());
}

#[test]
fn the_program_writes_its_matrix_as_a_page_and_as_json() {
    let out = tempfile::tempdir().unwrap();
    let line = "stability --quiet --json --cases f16,G01,O06 --methods logistic,decay --out";
    let mut words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
    words.push(out.path().into());
    let mut stdout = Vec::new();
    execute(words, &mut stdout).unwrap();
    let json: Value = serde_json::from_slice(&stdout).unwrap();
    assert_eq!(json["rows"].as_array().unwrap().len(), 3);
    assert_eq!(json["non_finite"], 0);
    let page = std::fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("loss times a factor") && page.contains("<svg"));
    let kept = std::fs::read(out.path().join("stability.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&kept).unwrap(), json);
}

/// The JSON of a successful command.
fn run(line: &str, out: &std::path::Path) -> Value {
    let mut words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
    words.extend(["--quiet".into(), "--json".into(), "--out".into(), out.into()]);
    let mut stdout = Vec::new();
    execute(words, &mut stdout).unwrap();
    serde_json::from_slice(&stdout).unwrap()
}

/// The matrix without its times, which differ between runs.
fn timeless(mut matrix: Value) -> Value {
    matrix["seconds"] = Value::Null;
    for row in matrix["rows"].as_array_mut().unwrap() {
        for outcome in row["outcomes"].as_array_mut().unwrap() {
            outcome["seconds"] = Value::Null;
        }
    }
    matrix
}

#[test]
fn shards_part_the_pairs_of_case_and_method_and_together_make_the_matrix() {
    let line = "stability --cases F16,G01,O06 --methods logistic,decay";
    let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let expected = timeless(run(line, whole.path()));
    for [shard, finished] in [["2/4", "2"], ["1/4", "2"], ["3/4", "1"]] {
        let part = run(&format!("{line} --shard {shard}"), parts.path());
        assert_eq!(part["finished"].to_string(), finished);
    }
    assert!(!parts.path().join("stability.json").exists(), "a shard has no matrix");
    assert_eq!(timeless(run(&format!("{line} --resume"), parts.path())), expected);
    let made = std::fs::read_to_string(parts.path().join("stability.jsonl")).unwrap();
    assert_eq!(made.lines().count(), 1, "only what no shard has made is made");
}

#[test]
fn a_case_that_does_not_exist_is_answered_with_those_that_do() {
    let words = ["stability", "--cases", "O01,X99"].map(OsString::from).to_vec();
    let failure = execute(words, &mut Vec::new()).unwrap_err();
    assert_eq!(failure.code, 2);
    assert!(failure.message.contains("\"X99\"; known are F16, G01"), "{failure}");
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    let program = Program::new(env!("CARGO_BIN_EXE_stability")).on_one_thread();
    for threads in ["", " --threads 3"] {
        let out = tempfile::tempdir().unwrap();
        let line = format!("--cases F16,G01,O06 --methods logistic,decay{threads}");
        let json = program.run_in(out.path(), &line).unwrap();
        assert_eq!(json["rows"].as_array().unwrap().len(), 3);
    }
}

#[test]
fn cases_run_where_the_caller_is_the_only_thread_of_its_pool() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let out = tempfile::tempdir().unwrap();
    let json = pool.install(|| run("stability --cases F16 --methods logistic", out.path()));
    assert_eq!(json["rows"].as_array().unwrap().len(), 1);
}
