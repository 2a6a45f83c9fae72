//! The numbers behind tables and charts, a record for every cell.

use std::fmt::Write;

use serde_json::{Value, json};
use softrast_runner::mean;

use crate::Measured;

/// One line for every cell.
pub(crate) fn csv(measured: &[Measured]) -> String {
    let mut text = String::from(
        "task,variant,method,runs,hard_last,hard_low,hard_high,hard_best_step,parameter_last,\
         success_rate,seconds_a_run\n",
    );
    for one in measured {
        let Measured { cell, hard, parameter, success_rate, seconds, .. } = one;
        let [low, high] = hard.ci95;
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{low},{high},{},{},{success_rate},{seconds}",
            cell.task.name(),
            cell.variant,
            cell.method_name(),
            cell.runs,
            hard.mean,
            mean(&one.returned()),
            parameter.mean
        );
    }
    text
}

/// The same with the settings and the values of every run.
pub(crate) fn json(measured: &[Measured]) -> String {
    let record = |one: &Measured| -> Value {
        json!({
            "task": one.cell.task.name(),
            "variant": one.cell.variant,
            "method": one.cell.method,
            "setting": one.settings,
            "runs": one.cell.runs,
            "hard_error": {
                "name": one.hard.name,
                "last": one.hard.per_run,
                "best_step": one.returned(),
            },
            "parameter_error": {"name": one.parameter.name, "last": one.parameter.per_run},
            "success_rate": one.success_rate,
            "seconds_a_run": one.seconds,
            "steps": one.steps,
        })
    };
    let records: Vec<Value> = measured.iter().map(record).collect();
    format!("{:#}\n", Value::from(records))
}
