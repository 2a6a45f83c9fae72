use std::path::Path;

use serde_json::Value;

/// Learning on a task, one outer step at a time.
pub trait Study {
    /// All that decides the result, beside what the task says of itself: what is learned and how.
    fn identity(&self) -> Value;

    /// Takes an outer step; `None` once learning has finished.
    ///
    /// # Errors
    ///
    /// If learning cannot go on.
    fn advance(&mut self) -> anyhow::Result<Option<OuterStep>>;

    /// Writes all that is needed to go on to the file at `path`; whenever the program dies, the file
    /// is the old one or the new one.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    fn save(&self, path: &Path, job: &str) -> anyhow::Result<()>;

    /// Goes on from such a file of the same job, and returns the number of the next outer step.
    ///
    /// # Errors
    ///
    /// If the file is damaged or of another job.
    fn resume(&mut self, path: &Path, job: &str) -> anyhow::Result<usize>;

    /// The best softness so far; `note` says in words where it comes from.
    ///
    /// # Errors
    ///
    /// If it cannot be written down.
    fn learned(&self, note: &str) -> anyhow::Result<Learned>;
}

/// What an outer step found about the softness it started with.
#[derive(Clone, Debug)]
pub struct OuterStep {
    /// Updates of the softness before it.
    pub step: usize,
    /// Mean outer loss over the batch; none after the last update.
    pub loss: Option<f64>,
    /// Mean loss over the validation instances, where it was due and finite.
    pub validation: Option<f64>,
    /// Everything about it, for one line of JSON.
    pub record: Value,
}

/// A learned softness.
#[derive(Clone, Debug)]
pub struct Learned {
    /// Files for `--softness` and its like: name and text.
    pub files: Vec<(&'static str, String)>,
    /// The learned functions beside those that learning started from.
    pub figures: Vec<Figure>,
    /// Numbers that were learned.
    pub parameters: usize,
    /// The step whose softness this is, and its validation loss, once there was a validation.
    pub best: Option<(usize, f64)>,
    /// Time of all outer steps so far, in seconds.
    pub seconds: f64,
    /// Instances tried, and those of them whose result was no finite number.
    pub instances: [usize; 2],
}

/// Curves in one chart.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What is to be seen.
    pub caption: String,
    /// Names of the axes.
    pub axes: [String; 2],
    /// Whether each axis is logarithmic; its values must be positive then.
    pub logarithmic: [bool; 2],
    /// At most eight.
    pub curves: Vec<Curve>,
}

/// One line of a chart.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// Its points in order; values that are not finite leave gaps.
    pub points: Vec<[f64; 2]>,
}
