//! Runs over their steps: tables and charts.

use std::{collections::BTreeMap, fmt::Write};

use crate::{
    Metric, Point, Role, Run, mean, mean_interval,
    plot::{Axis, Plot, Series},
};

/// Colours of the first experiment and of the one it is compared with.
const COLOURS: [[u8; 3]; 2] = [[31, 96, 168], [196, 84, 24]];

/// All points of all runs as CSV, one row per seed and step: `seed,step` and a column for every metric. Numbers have all their digits.
pub fn csv(metrics: &[Metric], runs: &[Run]) -> String {
    let mut text = String::from("seed,step");
    text.extend(metrics.iter().map(|metric| format!(",{}", metric.column())));
    text.push('\n');
    for (run, point) in runs.iter().flat_map(|run| run.curve.iter().map(move |p| (run, p))) {
        // Writing to a string cannot fail.
        let _ = write!(text, "{},{}", run.seed, point.step);
        text.extend(point.values.iter().map(|number| format!(",{number}")));
        text.push('\n');
    }
    text
}

/// Means of all runs of an experiment over the steps.
pub struct Convergence {
    /// Ascending steps: the step, the number of runs that reached it, and for each metric the mean and both ends of its 95 % interval.
    rows: Vec<(usize, usize, Vec<[f64; 3]>)>,
}

impl Convergence {
    /// The convergence of these runs. The intervals hold for each step separately, not jointly.
    pub fn new(metrics: &[Metric], runs: &[Run]) -> Self {
        let mut steps = BTreeMap::<usize, Vec<&Point>>::new();
        for point in runs.iter().flat_map(|run| &run.curve) {
            steps.entry(point.step).or_default().push(point);
        }
        let row = |(step, points): (usize, Vec<&Point>)| {
            let values = |k: usize| points.iter().map(|point| point.values[k]).collect();
            let lists = (0..metrics.len()).map(values);
            let spreads = lists.map(|list: Vec<f64>| {
                let [low, high] = mean_interval(&list);
                [mean(&list), low, high]
            });
            let spreads = spreads.collect();
            (step, points.len(), spreads)
        };
        Self { rows: steps.into_iter().map(row).collect() }
    }
}

/// Means over the runs as CSV, one row per experiment and step: `method,step,runs`, then three columns for the loss and each error,
/// such as `loss_mean`, `loss_low` and `loss_high`.
pub fn convergence_csv(metrics: &[Metric], experiments: &[(&str, &Convergence)]) -> String {
    let kept = |k: &usize| metrics[*k].role != Role::Trace;
    let kept: Vec<usize> = (0..metrics.len()).filter(kept).collect();
    let mut text = String::from("method,step,runs");
    for column in kept.iter().map(|&k| metrics[k].column()) {
        let _ = write!(text, ",{column}_mean,{column}_low,{column}_high");
    }
    text.push('\n');
    for (name, convergence) in experiments {
        for (step, runs, spreads) in &convergence.rows {
            let _ = write!(text, "{name},{step},{runs}");
            for [mean, low, high] in kept.iter().map(|&k| spreads[k]) {
                let _ = write!(text, ",{mean},{low},{high}");
            }
            text.push('\n');
        }
    }
    text
}

/// The score and the main errors over the steps, one chart each: a line for every experiment, with
/// the interval as a band if it has several runs.
pub fn charts(metrics: &[Metric], experiments: &[Convergence]) -> Vec<Plot> {
    let shown = |metric: &Metric| {
        metric.role == Role::Score || metric.role == Role::Error && !metric.key.contains('.')
    };
    let mut places: Vec<usize> = (0..metrics.len()).filter(|&k| shown(&metrics[k])).collect();
    places.sort_by_key(|&k| metrics[k].role != Role::Score);
    let chart = |k: usize| {
        let series = experiments.iter().zip(COLOURS).map(|(Convergence { rows }, colour)| Series {
            colour,
            points: rows.iter().map(|(step, _, at)| [*step as f64, at[k][0]]).collect(),
            band: rows.iter().map(|(_, _, at)| [at[k][1], at[k][2]]).collect(),
            ..Series::default()
        });
        Plot {
            series: series.collect(),
            from_zero: true,
            ..Plot::new(Axis::linear("step"), Axis::linear(&metrics[k].title()))
        }
    };
    places.into_iter().map(chart).collect()
}
