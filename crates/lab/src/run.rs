use image::RgbImage;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Metric, Progress};

/// An experiment that can be run on seeds: a problem with a method to solve it.
pub trait Experiment {
    /// Name among other experiments, such as `gauss`.
    fn name(&self) -> &str;

    /// Everything that determines the numbers, except the seed. It is the key of finished runs.
    fn identity(&self) -> Value;

    /// The metrics of every point, always the same list.
    fn metrics(&self) -> &[Metric];

    /// Steps of a run.
    fn steps(&self) -> usize;

    /// Number of seeds that one call of [`run`](Experiment::run) should solve together.
    fn batch_size(&self) -> usize {
        1
    }

    /// Runs every seed of the batch, and returns the runs in the order of the seeds.
    ///
    /// A run depends only on its seed, not on the others in its batch. Call [`Progress::step`]
    /// after every step, and pass its error on with `?`: that is how Ctrl-C ends a batch.
    ///
    /// # Errors
    ///
    /// Any reason that prevents the batch from running. A value that becomes non-finite is no error.
    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>>;
}

/// Seeds to run together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Batch {
    /// One run per seed; never empty.
    pub seeds: Vec<u64>,
    /// Whether the run of the first seed should have its [`Pictures`].
    pub pictures: bool,
}

/// Most frames of an animation.
const FRAMES: usize = 80;

impl Batch {
    /// Whether the state after `step` of `steps` should become a frame of the animation.
    ///
    /// True for step 0, the last step and evenly spaced steps between, at most 80 in all; always false for a batch without
    /// pictures.
    pub fn wants_frame(&self, step: usize, steps: usize) -> bool {
        let frame = |step: usize| step * (FRAMES - 1) / steps.max(1);
        self.pictures && (step == 0 || frame(step) > frame(step - 1))
    }
}

/// One run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// The seed of its instance.
    pub seed: u64,
    /// State before the first step, and after the steps that follow, the last included.
    pub curve: Vec<Point>,
    /// Whether it reached the goal.
    pub success: bool,
    /// Wall time of each step, in seconds: its share of the batch; without pictures and errors.
    pub step_seconds: Vec<f64>,
    /// Steps at which it stalled and restarted.
    #[serde(alias = "begun_again", default)]
    pub restarts: Vec<usize>,
    /// Warnings for the user, one line each, such as an empty target.
    pub warnings: Vec<String>,
    /// The first step with non-finite numbers; the curve ends before it.
    pub broke_at: Option<usize>,
    /// Pictures, if [`Batch::pictures`] requested them and this run is the first.
    #[serde(skip)]
    pub pictures: Option<Pictures>,
}

/// State of a run after some steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Steps made so far.
    pub step: usize,
    /// In the order of [`Experiment::metrics`].
    pub values: Vec<f64>,
}

/// The pictures of a run. All images have the same size.
#[derive(Clone, Debug, PartialEq)]
pub struct Pictures {
    /// The target image.
    pub target: RgbImage,
    /// The image before the first step.
    pub start: RgbImage,
    /// The image after the returned step.
    pub result: RgbImage,
    /// The steps for which [`Batch::wants_frame`] is true, in order.
    pub frames: Vec<RgbImage>,
    /// The result as SVG, if the task draws one.
    pub drawing: Option<String>,
}

impl Run {
    /// Wall time of all steps.
    pub fn seconds(&self) -> f64 {
        self.step_seconds.iter().sum()
    }

    /// The returned point of the run: the one with the smallest metric at `score`, the last of
    /// equal ones; `None` if that is finite nowhere.
    pub fn returned(&self, score: usize) -> Option<&Point> {
        best_point(&self.curve, score)
    }

    /// Ends the curve before the first non-finite point; such a run is no success.
    pub(crate) fn keep_finite(&mut self) {
        let finite = |point: &Point| point.values.iter().all(|x| x.is_finite());
        let Some(bad) = self.curve.iter().position(|point| !finite(point)) else { return };
        let step = self.curve[bad].step;
        self.warnings.push(format!(
            "seed {}: the numbers stop being finite at step {step}, so its results end before: try a smaller --learning-rate or a \
             larger --scale",
            self.seed
        ));
        self.curve.truncate(bad);
        (self.broke_at, self.success) = (Some(step), false);
    }

    /// Whether the run has this seed and number of metrics, and its points are complete, at steps from 0 on.
    pub(crate) fn fits(&self, seed: u64, metrics: usize, steps: usize) -> bool {
        let in_order = self.curve.iter().enumerate().all(|(k, point)| point.step == k);
        let whole = self.curve.iter().all(|point| point.values.len() == metrics);
        let ended =
            self.curve.len() == self.broke_at.unwrap_or(steps + 1) && self.curve.len() <= steps + 1;
        self.seed == seed && in_order && whole && ended && self.step_seconds.len() == steps
    }
}

/// The point of a curve with the smallest metric at `score`, the last of equal ones; `None` if that is finite nowhere.
pub fn best_point(curve: &[Point], score: usize) -> Option<&Point> {
    let finite = curve.iter().filter(|point| point.values[score].is_finite());
    finite
        .reduce(|best, point| if point.values[score] <= best.values[score] { point } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(values: &[f64]) -> Run {
        let curve = values.iter().enumerate().map(|(step, &x)| Point { step, values: vec![x] });
        let step_seconds = vec![0.1; values.len() - 1];
        Run { seed: 3, curve: curve.collect(), success: true, step_seconds, ..Run::default() }
    }

    #[test]
    fn the_last_of_the_best_steps_is_returned_and_what_is_no_number_never() {
        let all = run(&[0.5, 0.2, f64::NAN, 0.2, 0.4]);
        assert_eq!(all.returned(0).map(|point| point.step), Some(3));
        assert_eq!(best_point(&all.curve[2..3], 0), None);
        assert_eq!(best_point(&[], 0), None);
    }

    #[test]
    fn a_run_ends_before_it_stops_being_finite() {
        let mut broken = run(&[0.5, 0.2, f64::NAN, 0.2]);
        broken.keep_finite();
        assert_eq!((broken.curve.len(), broken.broke_at, broken.success), (2, Some(2), false));
        assert!(broken.fits(3, 1, 3) && broken.warnings[0].contains("step 2"));
        let mut sound = run(&[0.5, 0.2]);
        sound.keep_finite();
        assert!(sound.success && sound.fits(3, 1, 1));
        assert!(!sound.fits(4, 1, 1) && !sound.fits(3, 2, 1) && !sound.fits(3, 1, 2));
    }

    #[test]
    fn a_batch_asks_for_as_many_frames_as_an_animation_shows() {
        let batch = Batch { seeds: vec![0], pictures: true };
        for steps in [1, 2, 79, 80, 300, 1001] {
            let wanted: Vec<_> = (0..=steps).filter(|&k| batch.wants_frame(k, steps)).collect();
            assert_eq!(wanted.len(), (steps + 1).min(FRAMES), "{steps} steps");
            assert_eq!((wanted[0], wanted[wanted.len() - 1]), (0, steps));
        }
        let batch = Batch { pictures: false, ..batch };
        assert!((0..9).all(|k| !batch.wants_frame(k, 9)));
    }
}
