//! Two methods on the same seeds.

use std::fs;

use crate::disc::Disc;
use crate::line::{numbers, solved};

const LINE: &str = "evaluate --size 16 --steps 9 --runs 10";

#[test]
fn differences_are_those_of_two_evaluations_seed_by_seed() {
    let (_, first) = solved::<Disc>(&format!("{LINE} --learning-rate 0.1"));
    let (_, second) = solved::<Disc>(&format!("{LINE} --learning-rate 0.02"));
    let line = format!("{LINE} --learning-rate 0.1 --baseline 'logistic_--learning-rate_0.02'");
    let (out, both) = solved::<Disc>(&line);
    let baseline = &both["baseline"];
    for error in ["image_error", "parameter_error"] {
        assert_eq!(both[error], first[error]);
        assert_eq!(baseline[error], second[error]);
        let [one, two] = [&first, &second].map(|json| numbers(&json[error]["per_run"]));
        let expected: Vec<f64> = one.iter().zip(&two).map(|(one, two)| one - two).collect();
        let found = &baseline["difference"][error];
        for (found, expected) in numbers(&found["per_run"]).iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
        let mean = expected.iter().sum::<f64>() / 10.0;
        assert!((found["mean"].as_f64().unwrap() - mean).abs() < 1e-14);
        let [low, high] = [0, 1].map(|k| found["ci95"][k].as_f64().unwrap());
        assert!(low < mean && mean < high && high < 0.0, "{low} {mean} {high}");
        let share = |better: fn(f64) -> bool| {
            expected.iter().filter(|&&difference| better(difference)).count() as f64 / 10.0
        };
        assert_eq!(found["first_better"], share(|difference| difference < 0.0));
        assert_eq!(found["second_better"], share(|difference| difference > 0.0));
    }
    assert!(baseline["difference"]["image_error"]["hard"]["mean"].is_number());
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("logistic, learning rate 0.02"));
    let table = fs::read_to_string(out.path().join("convergence.csv")).unwrap();
    assert_eq!(table.lines().filter(|row| row.starts_with("baseline,")).count(), 10);
}

#[test]
fn a_method_does_not_differ_from_itself() {
    let (_out, both) = solved::<Disc>(&format!("{LINE} --baseline logistic"));
    let difference = &both["baseline"]["difference"]["parameter_error"];
    assert_eq!(numbers(&difference["per_run"]), [0.0; 10]);
    assert_eq!(difference["first_better"], 0.0);
    assert_eq!(difference["second_better"], 0.0);
}

#[test]
fn convergence_ends_with_the_results() {
    let (out, json) = solved::<Disc>(LINE);
    let table = fs::read_to_string(out.path().join("convergence.csv")).unwrap();
    let (header, rows) = table.split_once('\n').unwrap();
    let place = |name: &str| header.split(',').position(|column| column == name).unwrap();
    assert_eq!(rows.lines().count(), 10);
    let last: Vec<&str> = rows.lines().last().unwrap().split(',').collect();
    assert_eq!(last[..3], ["method", "9", "10"]);
    for (column, error) in [
        ("image_error", &json["image_error"]),
        ("image_error_hard", &json["image_error"]["hard"]),
        ("parameter_error", &json["parameter_error"]),
    ] {
        let number = |end| last[place(&format!("{column}_{end}"))].parse::<f64>().unwrap();
        let [mean, low, high] = ["mean", "low", "high"].map(number);
        assert!((error["final"].as_f64().unwrap() - mean).abs() < 1e-14);
        assert!(low < mean && mean < high);
        // 1,000 samples here, 10,000 there.
        let width = high - low;
        assert!((error["ci95"][0].as_f64().unwrap() - low).abs() < 0.1 * width);
    }
}
