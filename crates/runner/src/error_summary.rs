use std::collections::BTreeMap;

use serde::Serialize;

use crate::{
    Description, ErrorGroup, Measure, Run, bootstrap_mean_interval, mean, quantity::Quantity,
};

/// Samples behind a confidence interval, and the seed that draws them.
pub(crate) const RESAMPLES: usize = 10_000;
pub(crate) const RESAMPLING_SEED: u64 = 0;

/// One error over all runs: means over the runs, each run's own value where there may be several.
#[derive(Debug, Serialize)]
pub(crate) struct ErrorSummary {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    /// Before the first step.
    pub(crate) initial: f64,
    /// After the last step.
    #[serde(rename = "final")]
    pub(crate) last: f64,
    /// Lowest over all steps.
    pub(crate) best: f64,
    /// Of the mean of `last`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ci95: Option<[f64; 2]>,
    /// `last` of every run, in the order of the seeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) per_run: Option<Vec<f64>>,
    #[serde(flatten)]
    pub(crate) more: BTreeMap<&'static str, ErrorSummary>,
}

impl ErrorSummary {
    /// The main error of the group, with the further ones of that group inside.
    pub(crate) fn of_group(
        group: ErrorGroup,
        description: &Description,
        runs: &[Run],
        many: bool,
    ) -> Self {
        let (main, more) = Quantity::group(group, description);
        let of = |quantity: Quantity| Self::new(quantity, description, runs, many);
        let more = more.into_iter().map(|(key, quantity)| (key, of(quantity))).collect();
        Self { more, ..of(main) }
    }

    fn new(quantity: Quantity, description: &Description, runs: &[Run], many: bool) -> Self {
        let each = |pick: fn(&[f64]) -> f64| -> Vec<f64> {
            let curve = |run: &Run| run.curve.iter().map(|p| quantity.of(p)).collect::<Vec<_>>();
            runs.iter().map(|run| pick(&curve(run))).collect()
        };
        let last = each(|curve| curve[curve.len() - 1]);
        let Measure { name, unit } = quantity.measure(description);
        Self {
            name,
            unit,
            initial: mean(&each(|curve| curve[0])),
            last: mean(&last),
            best: mean(&each(|curve| curve.iter().copied().fold(f64::INFINITY, f64::min))),
            ci95: many.then(|| bootstrap_mean_interval(&last, RESAMPLES, RESAMPLING_SEED)),
            per_run: many.then_some(last),
            more: BTreeMap::new(),
        }
    }

    /// Name with the unit.
    pub(crate) fn title(&self) -> String {
        Measure { name: self.name, unit: self.unit }.title()
    }
}
