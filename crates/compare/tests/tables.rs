//! The tables of a comparison: every cell is there, and nothing is done twice.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fs;

use clap::Parser;
use compare::{Args, Cell, Measured, TaskName, compare, markdown};
use serde_json::{Value, json};

fn args(line: &str) -> Args {
    Args::parse_from(["compare"].into_iter().chain(line.split_whitespace()))
}

/// A cell whose hard errors by seed are these.
fn measured(method: &str, per_run: [f64; 3]) -> Measured {
    let task = TaskName::Pose;
    let cell = Cell { task, variant: "original", method: method.to_owned(), runs: 3 };
    let mean = per_run.iter().sum::<f64>() / 3.0;
    let error =
        json!({"name": "hard", "unit": "", "final": mean, "ci95": [0.0, 1.0], "per_run": per_run});
    let with = |key: &str| {
        let mut main = error.clone();
        main[key] = error.clone();
        main
    };
    let json: Value = json!({
        "image_error": with("hard"), "parameter_error": with("released"), "success_rate": 0.5,
        "seconds": {"step_median": 0.01}, "steps": 300, "size": 64, "faces": 9,
        "settings": {"scale": 0.03, "scale_end": 0.002, "learning_rate": 0.3},
    });
    Measured::new(cell, &json).unwrap()
}

#[test]
fn a_table_has_our_figures_their_differences_and_the_papers() {
    let table =
        markdown(&[measured("logistic", [0.1, 0.2, 0.3]), measured("gauss", [0.2, 0.3, 0.4])], "x");
    let row = table.lines().find(|line| line.starts_with("| gauss")).unwrap();
    let expected = "| gauss | scale 0.0300 to 0.00200, rate 0.300 | 0.300 (0.00 to 1.00) | \
                    **0.100 (0.100 to 0.100)** | 0.300 (0.00 to 1.00) | 50 % | 7.20 / 7.20 | \
                    15.3 / 0.190 |";
    assert_eq!(row, expected);
}

#[test]
fn cells_go_through_tasks_variants_and_methods() {
    let cells = args("--quick").cells().unwrap();
    assert_eq!(cells.len(), 4 * 2 * 5);
    assert_eq!((cells[0].task, cells[5].variant), (TaskName::Shape2d, "transfer"));
    let some = args("--tasks pose --methods gauss,a/b.json --runs 7").cells().unwrap();
    assert!(some.len() == 4 && some[3].runs == 7 && some[3].method_name() == "b");
    assert!(args("--tasks teapot").cells().unwrap_err().to_string().contains("shape2d"));
}

#[test]
fn a_comparison_is_not_done_twice() {
    let out = tempfile::tempdir().unwrap();
    let mut args = args("--tasks occlusion --methods exp --runs 1 --quiet");
    args.out = out.path().to_owned();
    compare(&args, "the command").unwrap();
    let read = || fs::read_to_string(out.path().join("results.md")).unwrap();
    let journal = out.path().join("occlusion-transfer-exp-1/evaluate.jsonl");
    let (tables, lines) = (read(), fs::read(&journal).unwrap());
    assert!(tables.contains("the command") && tables.matches("\n| exp |").count() == 2, "{tables}");
    compare(&args, "the command").unwrap();
    assert_eq!((read(), fs::read(&journal).unwrap()), (tables, lines));
}
