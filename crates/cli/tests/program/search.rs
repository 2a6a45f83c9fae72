//! The search finds what is known to be best, and scores it on other seeds.

use std::fs;

use crate::disc::Disc;
use crate::line::{file, json, numbers, run_in, solved};
use serde_json::Value;

/// In so few steps a small rate goes nowhere, and a large one far beyond.
const KNOWN: &str = "search --size 16 --steps 3 --runs 6 --search-runs 4 --schedule static \
                     --scale 0.05 --learning-rates 0.001,0.1,10";

#[test]
fn a_search_keeps_the_best_of_what_it_tries() {
    let (out, json) = solved::<Disc>(KNOWN);
    let found = &json["search"];
    assert_eq!(found, &file(out.path(), "search.json"));
    let best = found["best"]["learning_rate"].as_f64().unwrap();
    assert!(best > 0.001 && best < 10.0, "{best}");
    let flags = format!("--schedule static --scale 0.05 --learning-rate {best}");
    assert_eq!(found["best"]["flags"], flags);
    assert_eq!(found["score"]["name"], "hard MSE");
    let means =
        found["cells"].as_array().unwrap().iter().map(|cell| cell["mean"].as_f64().unwrap());
    assert_eq!(found["best"]["mean"], means.fold(f64::INFINITY, f64::min));
    let cells = found["cells"].as_array().unwrap();
    let stages: Vec<&str> = cells.iter().map(|cell| cell["grid"].as_str().unwrap()).collect();
    assert_eq!(stages, ["coarse", "coarse", "coarse", "fine", "fine"]);
    for cell in cells {
        assert_eq!((&cell["n"], &cell["non_finite"]), (&4.into(), &0.into()));
        let scores = numbers(&cell["per_run"]);
        let mean = scores.iter().sum::<f64>() / 4.0;
        assert!((cell["mean"].as_f64().unwrap() - mean).abs() < 1e-14);
        assert!(cell["seconds"].as_f64().unwrap() > 0.0);
    }
    let table = fs::read_to_string(out.path().join("search.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + cells.len());
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("Search</h2>") && page.contains("<svg") && page.contains("<table"));
}

#[test]
fn the_score_is_of_seeds_that_the_search_never_saw() {
    let (_out, json) = solved::<Disc>(KNOWN);
    let found = &json["search"];
    assert_eq!((&found["training_seed"], &found["training_runs"]), (&1_000_000.into(), &4.into()));
    let flags = found["best"]["flags"].as_str().unwrap();
    let line = format!("evaluate --size 16 --steps 3 {flags}");
    let (_out, held_out) = solved::<Disc>(&format!("{line} --runs 6"));
    assert_eq!(json["image_error"], held_out["image_error"]);
    assert_eq!(found["held_out"]["mean"], held_out["image_error"]["hard"]["final"]);
    assert_eq!(found["held_out"]["ci95"], held_out["image_error"]["hard"]["ci95"]);
    let (_out, training) = solved::<Disc>(&format!("{line} --runs 4 --seed 1000000"));
    assert_eq!(found["best"]["per_run"], training["image_error"]["hard"]["per_run"]);
}

#[test]
fn a_setting_that_blows_up_is_counted_and_not_chosen() {
    let line = "search --size 8 --steps 40 --runs 2 --search-runs 3 --scale 0.1 --schedule static \
                --learning-rates 0.3,1e39";
    let (out, json) = solved::<Disc>(line);
    let bad: Vec<&Value> = json["search"]["cells"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|cell| cell["non_finite"] == 3)
        .collect();
    assert!(!bad.is_empty());
    assert!(bad.iter().all(|cell| cell["n"] == 0 && cell["mean"].is_null()));
    assert_eq!(json["search"]["best"]["non_finite"], 0);
    let table = fs::read_to_string(out.path().join("search.csv")).unwrap();
    assert!(table.contains(",1e39,,0,3,0,"), "{table}");
}

#[test]
fn no_setting_that_works_is_an_error() {
    let line = "search --size 8 --steps 40 --search-runs 2 --scale 0.1 --schedule static \
                --learning-rates 1e39,1e40";
    let root = tempfile::tempdir().unwrap();
    let (_, ended) = run_in::<Disc>(&root.path().join("out"), line);
    let failure = ended.unwrap_err();
    assert!(failure.message.contains("smaller --learning-rates"), "{failure}");
}

#[test]
fn a_task_that_says_nothing_is_searched_around_its_defaults() {
    let line = "search --size 8 --steps 2 --runs 2 --search-runs 1";
    let (_out, json) = solved::<Disc>(line);
    let cells = json["search"]["cells"].as_array().unwrap();
    let coarse = cells.iter().filter(|cell| cell["grid"] == "coarse");
    assert_eq!(coarse.clone().count(), (5 + 10) * 3);
    let own = |cell: &&Value| cell["scale"] == 0.05 && cell["learning_rate"] == 0.02;
    assert_eq!(coarse.clone().filter(own).count(), 1 + 2);
}

#[test]
fn another_command_in_the_folder_keeps_the_search() {
    let (out, _) = solved::<Disc>(KNOWN);
    let before = file(out.path(), "search.json");
    let (stdout, ended) = run_in::<Disc>(out.path(), "--size 16 --steps 3");
    ended.unwrap();
    assert_eq!(json(&stdout)["command"], "solve");
    assert_eq!(file(out.path(), "search.json"), before);
    assert!(!out.path().join("convergence.csv").exists());
}

#[test]
fn the_simplest_method_that_is_as_good_as_the_best_is_chosen() {
    let (out, json) = solved::<Disc>("choose --size 16 --steps 3 --search-runs 3");
    let stages = json["choice"]["stages"].as_array().unwrap();
    let of: Vec<&str> = stages.iter().map(|stage| stage["of"].as_str().unwrap()).collect();
    assert_eq!(of, ["softness", "resolution", "tolerance"]);
    for stage in stages {
        let reasons = stage["reasons"].as_array().unwrap();
        let chosen = reasons.iter().filter(|reason| reason["verdict"] == "chosen");
        assert_eq!(chosen.count(), 1, "{stage}");
        assert!(reasons.iter().all(|reason| numbers(&reason["errors"]).len() == 3));
    }
    assert_eq!(file(out.path(), "choose.json")["choice"], json["choice"]);
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains(json["flags"].as_str().unwrap()), "{page}");
}

#[test]
fn auto_solves_with_what_is_chosen_and_returns_the_best_step() {
    let line = "--size 16 --steps 3";
    let (_out, choice) = solved::<Disc>(&format!("choose {line}"));
    let (_out, auto) = solved::<Disc>(&format!("{line} --softness auto"));
    let flags = choice["flags"].as_str().unwrap();
    let (_out, plain) = solved::<Disc>(&format!("{line} {flags}"));
    assert_eq!(auto["image_error"], plain["image_error"]);
    let returned = &plain["returned"];
    assert_eq!((&returned["by"], &returned["of"]), (&"hard MSE".into(), &3.into()));
    assert_eq!(returned["error"], plain["image_error"]["hard"]["best"]);
}
