use softrast_cli::method_colour;
use softrast_lab::{
    format::short_or_none,
    plot::{Axis, Plot, Series},
    report::{Beside, Report, Table},
};

use crate::{LevelOutcome, Matrix, Outcome, Row};

const ABOUT: &str =
    "Where each softness fails: every method on scenes that break rasterizers and optimisers";
const READING: &str = "Share of the trials that reach the target of the case, and the first level at which fewer than half do. A low share \
                       shows where a method fails; only numbers that are not finite would be a fault of the program. decay is the \
                       logistic with a scale that falls over the steps; mlp is a network of 56 weights.";
/// Smaller measured numbers are drawn as this one.
const LEAST: f64 = 1e-9;

/// The matrix and all its levels as one self-contained page.
pub(crate) fn html(matrix: &Matrix, command: &str) -> anyhow::Result<String> {
    let mut report = Report::new("stability", ABOUT);
    report.paragraph(&counts(matrix));
    report.warnings(&matrix.faults());
    report.heading("Matrix");
    report.paragraph(READING);
    report.table(&table(matrix, true));
    for row in &matrix.rows {
        report.heading(&format!("{}: {}", row.case.id, row.case.name));
        report.table(&Table::pairs([
            ["Scene", row.case.scene],
            ["Levels", row.case.perturbation],
            ["Measure", row.case.measure],
            ["Target", row.case.target],
        ]));
        if row.outcomes.iter().all(has_axis) {
            let (plot, caption) = chart(row);
            report.chart(&plot.svg()?, caption);
        }
        report.folded("Measured numbers: median (worst), share", |report| {
            report.table(&levels(matrix, row));
        });
    }
    Ok(report.finish(command, &[Beside::new("stability.json", "every level of every case")]))
}

/// The matrix for a terminal.
pub(crate) fn lines(matrix: &Matrix) -> Vec<String> {
    let mut lines = table(matrix, false).lines();
    lines.push(counts(matrix));
    lines.extend(matrix.faults());
    lines
}

fn counts(matrix: &Matrix) -> String {
    let Matrix { methods, rows, trials, non_finite, seconds } = matrix;
    let (cases, methods) = (rows.len(), methods.len());
    format!(
        "{cases} cases, {methods} methods, {trials} trials, {seconds:.0} s one after the other; not finite: {non_finite}."
    )
}

fn table(matrix: &Matrix, with_levels: bool) -> Table {
    let head = ["", "Case"].map(str::to_owned).into_iter().chain(matrix.methods.clone());
    let mut table = Table::new(head);
    for row in &matrix.rows {
        let cell = |outcome: &Outcome| match outcome.fails_at().filter(|_| with_levels) {
            Some(level) => format!("{}, fails: {}", outcome.share(), level.label),
            None => outcome.share(),
        };
        let name = [row.case.id, row.case.name].map(str::to_owned).into_iter();
        table.push(name.chain(row.outcomes.iter().map(cell)));
        let share = |outcome: &Outcome| match outcome.trials {
            0 => Some(0.0),
            trials => Some(outcome.reached as f64 / trials as f64).filter(|&share| share < 1.0),
        };
        let blank = [None, None].into_iter();
        table.shade_last(blank.chain(row.outcomes.iter().map(share)).collect());
    }
    table
}

fn levels(matrix: &Matrix, row: &Row) -> Table {
    let mut table = Table::new(["Level".to_owned()].into_iter().chain(matrix.methods.clone()));
    let levels = row.outcomes.first().map_or(&[][..], |outcome| &outcome.levels);
    for (k, level) in levels.iter().enumerate() {
        let numbers = |level: &LevelOutcome| {
            let [median, worst] = [level.median, level.worst].map(short_or_none);
            format!("{median} ({worst}), {}/{}", level.reached, level.trials)
        };
        let cell = |outcome: &Outcome| outcome.levels.get(k).map(numbers).unwrap_or_default();
        table.push([level.label.clone()].into_iter().chain(row.outcomes.iter().map(cell)));
    }
    table
}

fn has_axis(outcome: &Outcome) -> bool {
    outcome.levels.len() > 1 && outcome.levels.iter().all(|level| level.at.is_some())
}

/// Chart over the levels of the share of trials that reach the target, or of the measured number if levels have one trial.
fn chart(row: &Row) -> (Plot, &'static str) {
    let levels = || row.outcomes.iter().flat_map(|outcome| &outcome.levels);
    let shares = levels().any(|level| level.trials > 1);
    let decades = |numbers: Vec<f64>| {
        let least = numbers.iter().copied().fold(f64::INFINITY, f64::min);
        least > 0.0 && numbers.iter().any(|&x| x > 20.0 * least)
    };
    let value = |level: &LevelOutcome| level.worst.map(|worst| worst.max(LEAST));
    let x = match decades(levels().filter_map(|level| level.at).collect()) {
        true => Axis::logarithmic(row.case.perturbation),
        false => Axis::linear(row.case.perturbation),
    };
    let (y, caption) = match shares {
        true => (
            Axis::linear("share of trials"),
            "Share of trials that reach the target over the level, with its 95 % interval (Wilson).",
        ),
        false => (
            match decades(levels().filter_map(value).collect()) {
                true => Axis::logarithmic("measured"),
                false => Axis::linear("measured"),
            },
            "What is measured over the level; one trial at each.",
        ),
    };
    let mut plot = Plot { from_zero: shares, ..Plot::new(x, y) };
    for outcome in &row.outcomes {
        let mut series = Series {
            name: outcome.method.clone(),
            colour: method_colour(&outcome.method),
            dashed: outcome.method == "decay",
            marked: true,
            ..Series::default()
        };
        for level in &outcome.levels {
            let Some(at) = level.at else { continue };
            if shares {
                series.points.push([at, level.reached as f64 / level.trials.max(1) as f64]);
                series.band.push(level.ci95);
            } else if let Some(value) = value(level) {
                series.points.push([at, value]);
            }
        }
        plot.series.push(series);
    }
    (plot, caption)
}
