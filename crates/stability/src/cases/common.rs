//! Shared code of the cases.

use softrast_cli::{Task, Variant};

use crate::{Config, Level, Tested, Trial};

/// Softness, in NDC, of cases that do not vary it.
pub const SCALE: f64 = 0.03;

/// The original variant of a task, on 24 × 24 pixels, otherwise with its defaults.
pub(super) const ORIGINAL: Config = Config {
    variant: Variant::Original,
    size: 24,
    steps: None,
    learning_rate: None,
    scale: None,
    runs: 1,
};

/// Indices of a task's metrics: parameter error, and error of the hard image.
pub(super) const PARAMETER: usize = 2;
pub(super) const HARD: usize = 4;

/// One level for each strength of a perturbation.
pub(super) fn levels<T>(
    strengths: impl IntoIterator<Item = T>,
    level: impl FnMut(T) -> anyhow::Result<Level>,
) -> anyhow::Result<Vec<Level>> {
    strengths.into_iter().map(level).collect()
}

/// Solves seeds of a task, one trial each: the metric at index `measured` where the hard image is best. A trial reaches its target if the
/// run succeeds.
pub(super) fn trials<T: Task>(
    tested: &Tested,
    args: T::Args,
    config: &Config,
    measured: usize,
) -> anyhow::Result<Vec<Trial>> {
    let runs = tested.solve::<T>(args, config)?;
    let trial = |run: &softrast_lab::Run| {
        let value = run.returned(HARD).map_or(f64::NAN, |point| point.values[measured]);
        let finite = run.curve.iter().flat_map(|point| &point.values).all(|x| x.is_finite());
        Trial { value, reached: finite && run.success, finite }
    };
    Ok(runs.iter().map(trial).collect())
}

/// Trials with another target: at most `limit`.
pub(super) fn with_limit(mut trials: Vec<Trial>, limit: f64) -> Vec<Trial> {
    trials.iter_mut().for_each(|trial| trial.reached = trial.finite && trial.value <= limit);
    trials
}
