use std::fmt::Write;

use crate::{Description, Run, convergence::Convergence, quantity::Quantity};

/// All points of all runs as CSV, one row per seed and step; numbers keep all their digits.
///
/// Columns: `seed,step,loss,image_error,parameter_error,scale`, then one per further error, such as
/// `image_error_hard`.
pub(crate) fn curve(description: &Description, runs: &[Run]) -> String {
    let mut text = String::from("seed,step,loss,image_error,parameter_error,scale");
    for k in 0..description.extra.len() {
        text += &format!(",{}", Quantity::Extra(k).column(description));
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

/// Means over the runs as CSV, one row per method and step.
///
/// Columns: `method,step,runs`, then three for the loss and each error, such as `loss_mean`,
/// `loss_low` and `loss_high`, the last two being the ends of the 95 % interval of the mean.
pub(crate) fn convergence(description: &Description, methods: &[(&str, &Convergence)]) -> String {
    let columns: Vec<_> =
        Quantity::all(description).into_iter().map(|q| q.column(description)).collect();
    let mut text = String::from("method,step,runs");
    for column in &columns {
        let _ = write!(text, ",{column}_mean,{column}_low,{column}_high");
    }
    text.push('\n');
    for (method, convergence) in methods {
        for row in &convergence.rows {
            let _ = write!(text, "{method},{},{}", row.step, row.runs);
            for spread in &row.spreads {
                let _ = write!(text, ",{},{},{}", spread.mean, spread.low, spread.high);
            }
            text.push('\n');
        }
    }
    text
}
