//! The quick part of the suite keeps every promise, and the program says what it found.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{collections::HashSet, ffi::OsString};

use serde_json::Value;
use stability::{Matrix, Promise, Tested, cases, chosen, execute, run};

#[test]
fn nothing_in_the_quick_part_is_broken() {
    // The promises, with the methods that are quick to draw with: the program runs all.
    let mut cases = chosen("quick").unwrap();
    cases.retain(|case| case.promise == Promise::Guaranteed);
    let mut methods = Tested::all(None);
    methods.retain(|method| ["logistic", "mlp", "decay"].contains(&method.name));
    let outcomes = run(&cases, &methods, 2, true);
    let matrix = Matrix::new(&cases, &methods, outcomes, 0.0);
    assert_eq!((matrix.faults(), matrix.non_finite), (Vec::new(), 0));
}

#[test]
fn every_case_has_its_own_name_and_there_are_enough_of_them() {
    let ids: Vec<&str> = cases().map(|case| case.id).collect();
    assert!(ids.len() >= 40, "{} cases", ids.len());
    assert_eq!(ids.iter().collect::<HashSet<_>>().len(), ids.len());
    assert_eq!(Tested::all(None).len(), 6);
}

#[test]
fn the_program_writes_its_matrix_as_a_page_and_as_json() {
    let out = tempfile::tempdir().unwrap();
    let line = "stability --quiet --json --cases f06,G05,O06 --out";
    let mut words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
    words.push(out.path().into());
    let mut stdout = Vec::new();
    execute(words, &mut stdout).unwrap();
    let json: Value = serde_json::from_slice(&stdout).unwrap();
    assert_eq!(json["rows"].as_array().unwrap().len(), 3);
    assert_eq!((&json["non_finite"], &json["broken"]), (&0.into(), &0.into()));
    let page = std::fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("copies of a face") && page.contains("<svg"));
    let kept = std::fs::read(out.path().join("stability.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&kept).unwrap(), json);
}

#[test]
fn a_case_that_does_not_exist_is_answered_with_those_that_do() {
    let words = ["stability", "--cases", "F01,X99"].map(OsString::from);
    let failure = execute(words, &mut Vec::new()).unwrap_err();
    assert_eq!(failure.code, 2);
    assert!(failure.message.contains("\"X99\"; known are F01, F02"), "{failure}");
}
