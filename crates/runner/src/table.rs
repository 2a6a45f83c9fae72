use std::fmt::Write;

use crate::{Description, ErrorGroup, Run};

/// All points of all runs as CSV, one row per seed and step; numbers keep all their digits.
///
/// Columns: `seed,step,loss,image_error,parameter_error,scale`, then one per further error, such as
/// `image_error_hard`.
pub(crate) fn csv(description: &Description, runs: &[Run]) -> String {
    let mut text = String::from("seed,step,loss,image_error,parameter_error,scale");
    for extra in &description.extra {
        let group = match extra.group {
            ErrorGroup::Image => "image",
            ErrorGroup::Parameter => "parameter",
        };
        text += &format!(",{group}_error_{}", extra.key);
    }
    text.push('\n');
    for (run, point) in runs.iter().flat_map(|run| run.curve.iter().map(move |p| (run, p))) {
        let numbers = [point.loss, point.image_error, point.parameter_error, point.scale];
        // Writing to a string does not fail.
        let _ = write!(text, "{},{}", run.seed, point.step);
        for number in numbers.iter().chain(&point.extra) {
            let _ = write!(text, ",{number}");
        }
        text.push('\n');
    }
    text
}
