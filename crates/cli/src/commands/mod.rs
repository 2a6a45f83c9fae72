//! The commands of a task.

pub(crate) mod choose;
pub(crate) mod evaluate;
pub(crate) mod learn;
mod runs;
pub(crate) mod search;

use serde_json::{Map, Value};
use softrast_lab::{
    format::short,
    report::{Report, Table},
};

/// A setting in words, and its value.
fn in_words((key, value): (&String, &Value)) -> [String; 2] {
    let text = match value {
        Value::String(text) => text.clone(),
        // The JSON next to the page has all digits.
        Value::Number(number) if number.is_f64() => short(number.as_f64().unwrap_or(f64::NAN)),
        other => other.to_string(),
    };
    [key.replace('_', " "), text]
}

/// All settings that determine the numbers, as a section of a page.
fn settings_section(report: &mut Report, settings: [&Map<String, Value>; 2]) {
    report.heading("Settings");
    report.table(&Table::pairs(settings.into_iter().flatten().map(in_words)));
}

/// An error that ended the work, with a note on stored runs.
pub(crate) fn with_resume_hint(error: anyhow::Error, kept: usize) -> anyhow::Error {
    if kept == 0 {
        return error;
    }
    error.context("what was finished before is kept, and --resume goes on from it")
}
