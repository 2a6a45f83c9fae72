//! The numbers behind tables and charts, a record for every cell.

use std::fmt::Write;

use serde_json::{Value, json};
use softrast_lab::mean;

use crate::Measured;

/// One line for every cell.
pub(crate) fn csv(measured: &[Measured]) -> String {
    let mut text = String::from(
        "task,variant,method,runs,hard_last,hard_low,hard_high,hard_best_step,parameter_last,success_rate,seconds_a_run\n",
    );
    for one in measured {
        let (hard, cell) = (one.hard(), &one.cell);
        let [low, high] = hard.ci95;
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{low},{high},{},{},{},{}",
            cell.task.name(),
            cell.variant.name(),
            cell.name,
            cell.runs,
            hard.mean,
            mean(&one.returned()),
            one.parameter().mean,
            one.success_rate(),
            one.seconds
        );
    }
    text
}

/// The same with the settings and the values of every run.
pub(crate) fn json(measured: &[Measured]) -> Value {
    let record = |one: &Measured| -> Value {
        json!({
            "task": one.cell.task.name(),
            "variant": one.cell.variant.name(),
            "method": one.cell.name,
            "setting": one.setting(),
            "runs": one.cell.runs,
            "hard_error": {
                "name": one.title(one.hard_place()),
                "last": one.hard().per_run,
                "best_step": one.returned(),
            },
            "parameter_error": { "last": one.parameter().per_run },
            "success_rate": one.success_rate(),
            "seconds_a_run": one.seconds,
            "steps": one.entry.solve.steps,
        })
    };
    measured.iter().map(record).collect()
}
