//! The search finds what is known to be best, and scores it on other seeds.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod line;
#[path = "../examples/parabola.rs"]
mod parabola;

use std::fs;

use line::{file, json, numbers, run_in, solved};
use parabola::Parabola;
use serde_json::Value;

/// Gradient descent on the squared distance is there in one step at a rate of 1/2.
const KNOWN: &str = "search --size 16 --steps 3 --runs 6 --search-runs 4 --schedule static \
                     --scale 0.05 --learning-rates 0.05,0.5,0.8";

#[test]
fn a_search_finds_the_rate_that_is_known_to_be_best() {
    let (out, json) = solved::<Parabola>(KNOWN);
    let found = &json["search"];
    assert_eq!(found, &file(out.path(), "search.json"));
    assert_eq!(found["best"]["learning_rate"], 0.5);
    assert_eq!(found["best"]["flags"], "--schedule static --scale 0.05 --learning-rate 0.5");
    assert_eq!(found["score"]["name"], "IoU loss");
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
    assert!(page.contains("Search</h2>") && page.matches("<svg").count() == 2);
}

#[test]
fn the_score_is_of_seeds_that_the_search_never_saw() {
    let (_out, json) = solved::<Parabola>(KNOWN);
    let found = &json["search"];
    assert_eq!((&found["training_seed"], &found["training_runs"]), (&1_000_000.into(), &4.into()));
    let flags = found["best"]["flags"].as_str().unwrap();
    let line = format!("evaluate --size 16 --steps 3 {flags}");
    let (_out, held_out) = solved::<Parabola>(&format!("{line} --runs 6"));
    assert_eq!(json["image_error"], held_out["image_error"]);
    assert_eq!(found["held_out"]["mean"], held_out["image_error"]["final"]);
    assert_eq!(found["held_out"]["ci95"], held_out["image_error"]["ci95"]);
    let (_out, training) = solved::<Parabola>(&format!("{line} --runs 4 --seed 1000000"));
    assert_eq!(found["best"]["per_run"], training["image_error"]["per_run"]);
}

#[test]
fn a_setting_that_blows_up_is_counted_and_not_chosen() {
    let line = "search --size 8 --steps 40 --runs 2 --search-runs 3 --scale 0.1 --schedule static \
                --learning-rates 0.3,1e30";
    let (out, json) = solved::<Parabola>(line);
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
    assert!(table.contains(",1e30,,0,3,0,"), "{table}");
}

#[test]
fn no_setting_that_works_is_an_error() {
    let line = "search --size 8 --steps 40 --search-runs 2 --scale 0.1 --schedule static \
                --learning-rates 1e30,1e40";
    let root = tempfile::tempdir().unwrap();
    let (_, ended) = run_in::<Parabola>(&root.path().join("out"), line);
    let failure = ended.unwrap_err();
    assert!(failure.message.contains("smaller --learning-rates"), "{failure}");
}

#[test]
fn a_task_that_says_nothing_is_searched_around_its_defaults() {
    let line = "search --size 8 --steps 2 --runs 2 --search-runs 1";
    let (_out, json) = solved::<Parabola>(line);
    let cells = json["search"]["cells"].as_array().unwrap();
    let coarse = cells.iter().filter(|cell| cell["grid"] == "coarse");
    assert_eq!(coarse.clone().count(), (5 + 10) * 3);
    let own = |cell: &&Value| cell["scale"] == 0.02 && cell["learning_rate"] == 0.04;
    assert_eq!(coarse.clone().filter(own).count(), 1 + 2);
}

#[test]
fn another_command_in_the_folder_keeps_the_search() {
    let (out, _) = solved::<Parabola>(KNOWN);
    let before = file(out.path(), "search.json");
    let (stdout, ended) = run_in::<Parabola>(out.path(), "--size 16 --steps 3");
    ended.unwrap();
    assert_eq!(json(&stdout)["command"], "solve");
    assert_eq!(file(out.path(), "search.json"), before);
    assert!(!out.path().join("convergence.csv").exists());
}

#[test]
fn the_least_complex_method_is_chosen_where_it_is_enough() {
    // The parabola knows the logistic alone; the others are passed over.
    let (out, json) = solved::<Parabola>("choose --size 16 --steps 3 --search-runs 3");
    assert_eq!(json["flags"], "--softness logistic --schedule static");
    let stages = json["choice"]["stages"].as_array().unwrap();
    assert_eq!((stages.len(), &stages[0]["of"]), (1, &"softness".into()));
    let reasons = stages[0]["reasons"].as_array().unwrap();
    assert_eq!((reasons.len(), &reasons[0]["verdict"]), (2, &"chosen".into()));
    assert_eq!(numbers(&reasons[0]["errors"]).len(), 3);
    assert_eq!(file(out.path(), "choose.json")["choice"], json["choice"]);
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("--softness logistic --schedule static"), "{page}");
}

#[test]
fn auto_solves_with_what_is_chosen_and_returns_the_best_step() {
    let line = "--size 16 --steps 3 --learning-rate 0.6";
    let (_out, auto) = solved::<Parabola>(&format!("{line} --softness auto"));
    let (_out, plain) = solved::<Parabola>(line);
    assert_eq!(auto["image_error"], plain["image_error"]);
    let returned = &plain["returned"];
    assert_eq!((&returned["by"], &returned["of"]), (&"IoU loss".into(), &3.into()));
    assert_eq!(returned["error"], plain["image_error"]["best"]);
}
