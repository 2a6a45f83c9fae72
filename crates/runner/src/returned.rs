use serde::Serialize;

use crate::{Description, Run, best_step, mean, median, quantity::Quantity, summary::short};

/// Which step of its runs a program returns: the one where the score is least, see [`best_step`].
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Returned {
    /// The error that decides.
    pub(crate) by: &'static str,
    /// Its value there, mean over the runs.
    pub(crate) error: f64,
    /// The step, median over the runs.
    pub(crate) step: f64,
    /// Steps of a run.
    pub(crate) of: usize,
    #[serde(skip)]
    runs: usize,
}

impl Returned {
    pub(crate) fn new(description: &Description, score: Quantity, runs: &[Run]) -> Self {
        let best = runs.iter().filter_map(|run| best_step(&run.curve, |point| score.of(point)));
        let (errors, steps): (Vec<f64>, Vec<f64>) =
            best.map(|point| (score.of(point), point.step as f64)).unzip();
        Self {
            by: score.measure(description).name,
            error: mean(&errors),
            step: median(&steps),
            of: description.steps,
            runs: runs.len(),
        }
    }

    /// What that is, in words.
    pub(crate) fn says(&self) -> String {
        let Self { by, error, step, of, runs } = self;
        match runs {
            1 => format!("step {step} of {of}, where the {by} is lowest: {}", short(*error)),
            _ => format!(
                "of each run the step where the {by} is lowest: {}; in the middle step {step} of {of}",
                short(*error)
            ),
        }
    }
}
