//! The search finds the known optimum, and scores it on held-out seeds.

use std::fs;

use crate::disc::Disc;
use crate::line::{file, files, numbers, run_in, solved};
use serde_json::Value;

/// In so few steps a small rate barely moves, and a large one overshoots.
const KNOWN: &str = "search --size 16 --steps 3 --runs 6 --search-runs 4 --loops 60 --schedule static \
                     --scale 0.05 --learning-rates 0.001,10";

#[test]
fn a_search_keeps_the_best_of_what_it_tries() {
    let (out, json) = solved::<Disc>(KNOWN);
    let found = &json["search"];
    assert_eq!(found, &file(out.path(), "search.json"));
    let best = found["best"]["learning_rate"].as_f64().unwrap();
    assert!(best > 0.003 && best < 3.0, "{best}");
    let flags = found["best"]["flags"].as_str().unwrap();
    assert!(flags.starts_with("--schedule static --scale 0.05 --learning-rate "), "{flags}");
    assert_eq!(found["score"]["name"], "hard MSE");
    let trials = found["trials"].as_array().unwrap();
    let round = |k: u64| trials.iter().filter(move |trial| trial["round"] == k);
    assert!([1, 2, 3].map(|k| round(k).count() > 1) == [true; 3] && round(4).count() == 0);
    let means = round(3).map(|trial| trial["mean"].as_f64().unwrap());
    assert_eq!(found["best"]["mean"], means.fold(f64::INFINITY, f64::min));
    let loops = found["loops"].as_u64().unwrap();
    assert!((40..=60).contains(&loops), "{loops}");
    for trial in trials {
        let scores = numbers(&trial["per_run"]);
        let (n, seeds) = (scores.len(), 1 << (trial["round"].as_u64().unwrap() - 1));
        assert_eq!((n, &trial["non_finite"]), (seeds, &0.into()));
        let mean = scores.iter().sum::<f64>() / n as f64;
        assert!((trial["mean"].as_f64().unwrap() - mean).abs() < 1e-14);
        assert!(trial["seconds"].as_f64().unwrap() > 0.0);
    }
    let table = fs::read_to_string(out.path().join("search.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + trials.len());
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
    assert_eq!(found["held_out"]["mean"], held_out["image_error"]["hard"]["best"]);
    let (_out, training) = solved::<Disc>(&format!("{line} --runs 4 --seed 1000000"));
    assert_eq!(found["best"]["mean"], training["image_error"]["hard"]["best"]);
}

#[test]
fn a_setting_that_blows_up_is_counted_and_not_chosen() {
    let line = "search --size 8 --steps 40 --runs 2 --search-runs 1 --loops 12 --scale 0.1 --schedule static \
                --learning-rates 1e37,1e39";
    let (out, json) = solved::<Disc>(line);
    let trials = json["search"]["trials"].as_array().unwrap();
    let bad: Vec<&Value> = trials.iter().filter(|trial| trial["non_finite"] == 1).collect();
    assert!(!bad.is_empty());
    assert!(bad.iter().all(|trial| trial["n"] == 0 && trial["mean"].is_null()));
    assert_eq!(json["search"]["best"]["non_finite"], 0);
    let table = fs::read_to_string(out.path().join("search.csv")).unwrap();
    assert!(table.contains(",,0,1,0,"), "{table}");
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
    let line = "search --size 8 --steps 2 --runs 2 --search-runs 1 --loops 60";
    let (_out, json) = solved::<Disc>(line);
    let trials = json["search"]["trials"].as_array().unwrap();
    let of =
        |axis: &str| trials.iter().filter_map(|trial| trial[axis].as_f64()).collect::<Vec<_>>();
    assert_eq!((trials.len(), of("scale").len()), (60, 60));
    assert!(of("scale").iter().all(|x| (0.005..=0.5).contains(x)), "{:?}", of("scale"));
    assert!(of("learning_rate").iter().all(|x| (0.006..0.07).contains(x)));
    let (ends, surrogates) = (of("scale_end").len(), of("surrogate_scale").len());
    assert!((5..55).contains(&ends) && (5..55).contains(&surrogates), "{ends} {surrogates}");
    for trial in trials {
        let [scale, end, surrogate] =
            ["scale", "scale_end", "surrogate_scale"].map(|axis| trial[axis].as_f64());
        assert!(end.is_none_or(|end| Some(end) < scale), "{trial}");
        let ratio = surrogate.map(|one| one / scale.unwrap());
        assert!(ratio.is_none_or(|ratio| (0.69..6.01).contains(&ratio)), "{trial}");
    }
}

#[test]
fn ingredients_can_be_left_out_of_a_search() {
    let line =
        "search --size 8 --steps 2 --runs 2 --search-runs 1 --loops 20 --no-surrogate --rate-end 1";
    let (_out, json) = solved::<Disc>(line);
    let trials = json["search"]["trials"].as_array().unwrap();
    assert_eq!(trials.len(), 20);
    for trial in trials {
        assert!(trial["surrogate_scale"].is_null(), "{trial}");
        assert_eq!(trial["rate_end"].as_f64(), Some(1.0), "{trial}");
    }
}

#[test]
fn another_command_in_the_folder_keeps_the_search() {
    let (out, _) = solved::<Disc>(KNOWN);
    let before = files(out.path());
    let (_, ended) = run_in::<Disc>(out.path(), "--size 16 --steps 3");
    let failure = ended.unwrap_err();
    assert!(failure.message.contains("is a result of `disc search`"), "{failure}");
    assert_eq!(files(out.path()), before);
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
