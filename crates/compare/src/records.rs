//! The numbers behind the tables, one record per cell. Documents store them, so that their tables can be rebuilt.

use std::fmt::Write;

use anyhow::Context;
use serde::{Deserialize, Serialize};
use softrast_cli::{Schedule, Searched, SoftnessChoice, Variant, is_preset_learned};
use softrast_lab::{mean, mean_interval};

use crate::{Cell, Measured, Role, TASKS, tasks::AnyTask};

/// Significant digits of a stored number.
const DIGITS: usize = 5;

/// Results of a cell: one line of `cells.jsonl`.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Name of the task.
    pub task: String,
    /// Whether the variant is the original.
    pub original: bool,
    /// Name of the method.
    pub method: String,
    /// Name of the method's family, for the paper's tables; empty if it is not a named family.
    pub family: String,
    /// Scales, learning rate and other settings.
    pub setting: String,
    /// Whether the setting was searched for, learned, or named by its flags.
    pub chosen: bool,
    /// Whether it is in Table 3, and not only in Table 6.
    pub compared: bool,
    /// Whether it only varies another cell.
    pub varied: bool,
    /// Kind of the bundled softness and the task it was learned on, for Table 6.
    pub learned_on: Option<[String; 2]>,
    /// Pixels a side.
    pub size: usize,
    /// Steps of a run.
    pub steps: usize,
    /// Faces of the scene.
    pub faces: usize,
    /// Titles of the hard error and of the parameter error.
    pub titles: [String; 2],
    /// Time of the optimisation steps of a run, in seconds.
    pub seconds: f64,
    /// Image and parameter error in the unit of the paper's Table 3.
    pub in_papers_unit: [Option<f64>; 2],
    /// Number of successful runs.
    pub successes: usize,
    /// Hard errors at the last step, in the order of the seeds from 0.
    pub last: Vec<f64>,
    /// Hard errors of the returned steps.
    pub returned: Vec<f64>,
    /// Parameter errors at the last step.
    pub parameter: Vec<f64>,
}

impl Record {
    /// The record of a measured cell.
    pub fn of(one: &Measured) -> Self {
        let (cell, metrics) = (&one.cell, one.metrics());
        let family = match &cell.method.softness {
            Some(SoftnessChoice::Family(family)) => family.name(),
            _ => "",
        };
        let parameter = metrics.iter().position(|metric| metric.key == "parameter_error");
        let title = |place: Option<usize>| place.map(|place| one.title(place)).unwrap_or_default();
        let kept = |values: Vec<f64>| values.into_iter().map(kept).collect();
        Self {
            task: cell.task.name.to_owned(),
            original: cell.variant == Variant::Original,
            method: cell.name.clone(),
            family: family.to_owned(),
            setting: one.setting(),
            chosen: is_chosen(cell),
            compared: !matches!(cell.role, Role::Crossed(_)),
            varied: matches!(cell.role, Role::Varied(_)),
            learned_on: learned_on(cell),
            size: one.entry.solve.size,
            steps: one.entry.solve.steps,
            faces: one.entry.faces,
            titles: [title(Some(one.hard_place())), title(parameter)],
            seconds: self::kept(one.seconds),
            in_papers_unit: one.in_papers_unit().map(|error| error.map(self::kept)),
            successes: one.runs.iter().filter(|run| run.success).count(),
            last: kept(one.hard().per_run),
            returned: kept(one.returned()),
            parameter: kept(one.parameter().per_run),
        }
    }

    /// The task.
    ///
    /// # Panics
    ///
    /// If no task has this name, which is checked when records are read.
    pub fn task(&self) -> &'static AnyTask {
        let task = TASKS.iter().find(|task| task.name == self.task);
        task.unwrap_or_else(|| panic!("there is no task {}", self.task))
    }

    /// Name of the variant.
    pub fn variant(&self) -> &'static str {
        if self.original { Variant::Original.name() } else { Variant::Transfer.name() }
    }

    /// Share of runs that succeed.
    pub fn success_rate(&self) -> f64 {
        self.successes as f64 / self.last.len() as f64
    }
}

/// Kind of the bundled softness, and the task that it was learned on.
fn learned_on(cell: &Cell) -> Option<[String; 2]> {
    let task = cell.task.name;
    let kind = match &cell.method.softness {
        Some(SoftnessChoice::Preset) if is_preset_learned(task) => String::new(),
        Some(SoftnessChoice::Learned(kind)) => kind.clone().unwrap_or_default(),
        _ => return None,
    };
    match cell.role {
        Role::Crossed(from) => {
            let own = kind.strip_prefix(from).map(|kind| kind.trim_start_matches('-').to_owned());
            Some([own.unwrap_or(kind), from.to_owned()])
        }
        Role::Compared => Some([kind, task.to_owned()]),
        Role::Varied(_) => None,
    }
}

/// Rounds to the stored number of digits.
fn kept(x: f64) -> f64 {
    format!("{x:.*e}", DIGITS - 1).parse().unwrap_or(x)
}

/// Whether the setting of a cell was searched for, learned, or named by its flags.
fn is_chosen(cell: &Cell) -> bool {
    let method = &cell.method;
    let Some(SoftnessChoice::Family(family)) = &method.softness else { return true };
    if method.scale.is_some() || method.init.is_some() {
        return true;
    }
    [Schedule::Static, Schedule::Decay]
        .into_iter()
        .any(|usual| Searched::of(cell.task.name, family.name(), method.schedule, usual).is_some())
}

/// The records as text, one a line.
///
/// # Errors
///
/// If a number is not finite.
pub(crate) fn text(records: &[Record]) -> anyhow::Result<String> {
    let lines = records.iter().map(|record| Ok(serde_json::to_string(record)? + "\n"));
    lines.collect()
}

/// Parses records, one per line.
///
/// # Errors
///
/// If a line is not a record, or its task does not exist.
pub(crate) fn read(text: &str) -> anyhow::Result<Vec<Record>> {
    let line = |(k, line): (usize, &str)| -> anyhow::Result<Record> {
        let record: Record = serde_json::from_str(line)
            .with_context(|| format!("line {} is no record of a cell", k + 1))?;
        crate::task(&record.task)?;
        Ok(record)
    };
    text.lines().enumerate().map(line).collect()
}

/// CSV with one line per cell, for spreadsheets.
pub(crate) fn csv(records: &[Record]) -> String {
    let mut text = String::from(
        "task,variant,method,runs,hard_last,hard_low,hard_high,hard_best_step,parameter_last,success_rate,seconds_a_run\n",
    );
    for one in records {
        let [low, high] = mean_interval(&one.last);
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{low},{high},{},{},{},{}",
            one.task,
            one.variant(),
            one.method,
            one.last.len(),
            mean(&one.last),
            mean(&one.returned),
            mean(&one.parameter),
            one.success_rate(),
            one.seconds
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_digits_are_kept() {
        assert_eq!([0.0, 1.234_567_8, 0.000_123_456_78].map(kept), [0.0, 1.2346, 0.000_123_46]);
    }

    #[test]
    fn a_line_that_is_no_record_is_named() {
        let error = format!("{:#}", read("{\"task\": 1}\n").unwrap_err());
        assert!(error.starts_with("line 1 is no record of a cell"), "{error}");
    }
}
