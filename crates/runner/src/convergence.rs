use std::collections::BTreeMap;

use crate::{Description, Run, mean, quantity::Quantity, statistics::Resampling, task::Point};

/// Samples behind the interval at a step: fewer than behind those of the results, because there are
/// as many as steps and they are only drawn.
const RESAMPLES: usize = 1000;
const RESAMPLING_SEED: u64 = 0;

/// How all runs of a method go on, step by step.
pub(crate) struct Convergence {
    /// In the order of the steps.
    pub(crate) rows: Vec<Row>,
}

/// All runs after some steps.
pub(crate) struct Row {
    pub(crate) step: usize,
    /// Those that got here; a run whose numbers stop being finite does not.
    pub(crate) runs: usize,
    /// In the order of [`Quantity::all`].
    pub(crate) spreads: Vec<Spread>,
}

/// Mean over the runs and its 95 % bootstrap interval.
#[derive(Clone, Copy)]
pub(crate) struct Spread {
    pub(crate) mean: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Convergence {
    /// Of runs that are described so. The intervals hold at each step by itself, not jointly.
    pub(crate) fn new(description: &Description, runs: &[Run]) -> Self {
        let mut steps = BTreeMap::<usize, Vec<&Point>>::new();
        for point in runs.iter().flat_map(|run| &run.curve) {
            steps.entry(point.step).or_default().push(point);
        }
        let quantities = Quantity::all(description);
        let mut resampling = Resampling::new(runs.len(), RESAMPLES, RESAMPLING_SEED);
        let row = |(step, points): (usize, Vec<&Point>)| {
            if points.len() != resampling.values() {
                resampling = Resampling::new(points.len(), RESAMPLES, RESAMPLING_SEED);
            }
            let spread = |quantity: &Quantity| {
                let values: Vec<f64> = points.iter().map(|point| quantity.of(point)).collect();
                let [low, high] = resampling.mean_interval(&values);
                Spread { mean: mean(&values), low, high }
            };
            let spreads = quantities.iter().map(spread).collect();
            Row { step, runs: points.len(), spreads }
        };
        Self { rows: steps.into_iter().map(row).collect() }
    }
}
