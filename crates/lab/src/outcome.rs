use serde_json::{Map, Value, json};

use crate::{
    Experiment, Role, Run,
    error_summary::{ErrorSummary, errors_of, nested},
    place, wilson_interval,
};

/// The errors of some runs, and the number of successes.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub(crate) errors: Vec<ErrorSummary>,
    /// Number of successful runs, and of all runs.
    pub successes: [usize; 2],
    /// Whether there are intervals and values of each run.
    pub many: bool,
}

impl Outcome {
    /// A summary of finished runs, with intervals if `many`.
    ///
    /// # Errors
    ///
    /// If a run has a non-finite number even before its first step.
    pub(crate) fn new(
        experiment: &dyn Experiment,
        runs: &[Run],
        many: bool,
    ) -> anyhow::Result<Self> {
        if let Some(run) = runs.iter().find(|run| run.curve.is_empty()) {
            anyhow::bail!(
                "seed {}: the errors are not finite numbers before the first step: check that the target is in view and that the \
                 scale is not extreme",
                run.seed
            );
        }
        let score = place(experiment.metrics(), Role::Score);
        let of = |(k, metric)| ErrorSummary::new(metric, [k, score], runs, many);
        Ok(Self {
            errors: errors_of(experiment.metrics()).map(of).collect(),
            successes: [runs.iter().filter(|run| run.success).count(), runs.len()],
            many,
        })
    }

    /// The fields of runs in the results: their number, their errors, their success rate.
    pub(crate) fn json(&self) -> Map<String, Value> {
        let [successes, runs] = self.successes;
        let mut json = nested(self.errors.iter().map(|error| (&error.metric, json!(error))));
        json.insert("runs".into(), runs.into());
        json.insert("success_rate".into(), (successes as f64 / runs.max(1) as f64).into());
        if self.many {
            json.insert("success_ci95".into(), json!(wilson_interval(successes, runs)));
        }
        json
    }

    /// The share of successful runs.
    pub(crate) fn success_share(&self) -> String {
        let [successes, runs] = self.successes;
        let [low, high] = wilson_interval(successes, runs).map(|rate| rate * 100.0);
        let rate = successes as f64 / runs.max(1) as f64 * 100.0;
        format!("{rate:.1} % of runs, 95 % interval {low:.1} to {high:.1} %")
    }
}
