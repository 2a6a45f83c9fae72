use image::RgbImage;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Metric, Progress};

/// Something that can be run on seeds: a problem with a method to solve it.
pub trait Experiment {
    /// What it is called beside others, such as `gauss`.
    fn name(&self) -> &str;

    /// All that decides the numbers but the seed. Finished runs are kept by it.
    fn identity(&self) -> Value;

    /// What is measured at every point, always the same list.
    fn metrics(&self) -> &[Metric];

    /// Steps of a run.
    fn steps(&self) -> usize;

    /// How many seeds one call of [`run`](Experiment::run) should solve together.
    fn batch_size(&self) -> usize {
        1
    }

    /// Runs every seed of the batch, and returns the runs in the order of the seeds.
    ///
    /// A run depends on its seed alone, not on the others in its batch. Call [`Progress::step`] after every step, and pass its
    /// error on with `?`: that is how Ctrl-C ends a batch.
    ///
    /// # Errors
    ///
    /// Whatever keeps the batch from being run. A value that stops being finite is no error.
    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>>;
}

/// Seeds to run together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Batch {
    /// One run per seed; never empty.
    pub seeds: Vec<u64>,
    /// Whether the run of the first seed should bring its [`Pictures`].
    pub pictures: bool,
}

/// Most frames that an animation shows.
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
    /// What it was drawn from.
    pub seed: u64,
    /// State before the first step, and after the steps that follow, the last included.
    pub curve: Vec<Point>,
    /// Whether it reached what was asked for.
    pub success: bool,
    /// Wall time of each step, in seconds: its share of the batch; without pictures and errors.
    pub step_seconds: Vec<f64>,
    /// Steps at which it was stuck and began again from another start.
    #[serde(default)]
    pub begun_again: Vec<usize>,
    /// What the user should know, one line each, such as an empty target.
    pub warnings: Vec<String>,
    /// The first step whose numbers were not finite; the curve ends before it.
    pub broke_at: Option<usize>,
    /// Pictures, where [`Batch::pictures`] asked for them and this run is the first.
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

/// What a run looks like. All images have the same size.
#[derive(Clone, Debug, PartialEq)]
pub struct Pictures {
    /// What the run should arrive at.
    pub target: RgbImage,
    /// Before the first step.
    pub start: RgbImage,
    /// After the step that is returned.
    pub result: RgbImage,
    /// The steps for which [`Batch::wants_frame`] is true, in order.
    pub frames: Vec<RgbImage>,
    /// The result as SVG, where the task draws it.
    pub drawing: Option<String>,
}

impl Run {
    /// Wall time of all steps.
    pub fn seconds(&self) -> f64 {
        self.step_seconds.iter().sum()
    }

    /// The point that the run returns: where the metric at `score` is least, of equal ones the last; none where it is nowhere a
    /// finite number.
    pub fn returned(&self, score: usize) -> Option<&Point> {
        best_point(&self.curve, score)
    }

    /// Ends the curve before the first point that is not finite; that run is no success.
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

    /// Whether it has this seed and these metrics, at steps from 0 on.
    pub(crate) fn fits(&self, seed: u64, metrics: usize, steps: usize) -> bool {
        let in_order = self.curve.iter().enumerate().all(|(k, point)| point.step == k);
        let whole = self.curve.iter().all(|point| point.values.len() == metrics);
        let ended =
            self.curve.len() == self.broke_at.unwrap_or(steps + 1) && self.curve.len() <= steps + 1;
        self.seed == seed && in_order && whole && ended && self.step_seconds.len() == steps
    }
}

/// The point of a curve where the metric at `score` is least, of equal ones the last; none where it is nowhere finite.
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
