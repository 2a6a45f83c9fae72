use serde::{Deserialize, Serialize};

use crate::softness_file::stored::LARGEST_LOGARITHM;

/// Adaptive schedule: the error of a run determines its progress, as a closed loop, instead of
/// time.
///
/// The progress goes from 0 to 1 in a number of steps, more slowly while the error falls. A run
/// whose error is too large for its progress is stalled: it restarts at progress 0, from another
/// start if the problem has one, while enough steps are left. All fields except `patience` and
/// `stall_slope` are logarithms.
///
/// A run of fewer steps than `steps` scales the schedule: proportionally fewer steps at a
/// proportionally larger learning rate, at most twice as large.
///
/// The error is that of the hard image, which needs no knowledge of the true scene. Not in the
/// paper, whose softness is constant over a run.
///
/// ```
/// use softrast_inverse::{AdaptiveSchedule, AdaptiveStep, Controller};
///
/// let run = |error: f64| -> Vec<AdaptiveStep> {
///     let mut run: Controller = AdaptiveSchedule::START.controller(300);
///     (0..300).map(|step| run.next((step > 0).then_some(error))).collect()
/// };
/// let (good, stalled) = (run(0.01), run(0.5));
/// assert!(good[0].progress == 0.0 && good[299].progress == 1.0);
/// assert!(!good.iter().any(|step| step.restarts) && stalled.iter().any(|step| step.restarts));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdaptiveSchedule {
    /// Steps of the runs that it was learned on; not learned itself.
    pub steps: usize,
    /// Logarithm of the number of steps from progress 0 to 1 at constant error, in a run of `steps` or more.
    #[serde(alias = "passage")]
    pub duration: f64,
    /// Exponent of the slowdown while the error falls: the pace is multiplied by
    /// `(recent / earlier)^patience`, two running means of the error over about 5 and 20 steps.
    pub patience: f64,
    /// Logarithm of the error above which a run at progress 1 is stalled; it is compared with the least error since the last start.
    #[serde(alias = "stuck")]
    pub stall_threshold: f64,
    /// Added to `stall_threshold` at progress 0, decreasing linearly to 0 at progress 1.
    #[serde(alias = "early")]
    pub stall_slope: f64,
    /// Logarithm of the steps that must be left for a restart, as a share of those from progress 0 to 1.
    #[serde(alias = "room")]
    pub reserve: f64,
    /// Logarithm of the factor of the learning rate at progress 1; proportional to the progress before.
    pub rate_end: f64,
}

/// Progress and learning rate of a run at one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveStep {
    /// Progress along the schedule, 0 to 1.
    pub progress: f64,
    /// Factor of the learning rate.
    pub rate: f64,
    /// Whether the run was stalled and restarts here.
    pub restarts: bool,
}

/// State of a run under an [`AdaptiveSchedule`].
#[derive(Clone, Debug)]
pub struct Controller {
    schedule: AdaptiveSchedule,
    steps: usize,
    /// Steps taken so far.
    step: usize,
    progress: f64,
    seen: Option<Seen>,
}

/// Running means and minimum of the error since the last start.
#[derive(Clone, Copy, Debug)]
struct Seen {
    recent: f64,
    earlier: f64,
    least: f64,
}

/// Weights of the newest error in the running means.
const RECENT: f64 = 0.2;
const EARLIER: f64 = 0.05;
/// Added to both means, so that the trend is defined at an error of 0.
const SMALL: f64 = 1e-3;
/// Lower limit of the scaling of shorter runs, as a share of the steps learned on: larger steps would miss the pose.
const SHORTEST: f64 = 0.5;
/// Progress is rounded to multiples of one over this, so that renderers can be cached.
const LEVELS: f64 = 512.0;

impl AdaptiveSchedule {
    /// Number of learned parameters.
    pub const PARAMETERS: usize = 6;

    /// Start of learning: 100 steps from progress 0 to 1; stalled above an error of 0.05 at the end, or 0.22 halfway.
    pub const START: Self = Self {
        steps: 300,
        duration: 4.6,
        patience: 0.0,
        stall_threshold: -3.0,
        stall_slope: 3.0,
        reserve: -0.5,
        rate_end: 0.0,
    };

    /// Its parameters, in the order of the fields after the first.
    pub fn parameters(&self) -> [f64; Self::PARAMETERS] {
        let Self { steps: _, duration, patience, stall_threshold, stall_slope, reserve, rate_end } =
            *self;
        [duration, patience, stall_threshold, stall_slope, reserve, rate_end]
    }

    /// This schedule with other parameters, in the order of the fields after the first.
    #[must_use]
    pub fn with(
        self,
        [duration, patience, stall_threshold, stall_slope, reserve, rate_end]: [f64;
            Self::PARAMETERS],
    ) -> Self {
        Self { duration, patience, stall_threshold, stall_slope, reserve, rate_end, ..self }
    }

    /// The controller of a run of this many steps, before the first.
    pub fn controller(&self, steps: usize) -> Controller {
        Controller { schedule: *self, steps, step: 0, progress: 0.0, seen: None }
    }

    /// Returns the found and the expected value if it is invalid.
    pub(crate) fn check(&self) -> Result<(), String> {
        match self.parameters().into_iter().find(|x| x.is_nan() || x.abs() > LARGEST_LOGARITHM) {
            None => Ok(()),
            Some(wrong) => Err(format!(
                "a number of {wrong}, expected -{LARGEST_LOGARITHM} to {LARGEST_LOGARITHM}"
            )),
        }
    }
}

impl Controller {
    /// Progress and learning rate of the next step, given the error of the latest hard image, or
    /// `None` before the first. A non-finite error is ignored.
    pub fn next(&mut self, error: Option<f64>) -> AdaptiveStep {
        if let Some(error) = error.filter(|error| error.is_finite()) {
            let seen = self.seen.unwrap_or(Seen { recent: error, earlier: error, least: error });
            self.seen = Some(Seen {
                recent: seen.recent + RECENT * (error - seen.recent),
                earlier: seen.earlier + EARLIER * (error - seen.earlier),
                least: seen.least.min(error),
            });
        }
        let AdaptiveSchedule {
            steps,
            duration,
            patience,
            stall_threshold,
            stall_slope,
            reserve,
            rate_end,
        } = self.schedule;
        let shorter = (self.steps as f64 / steps.max(1) as f64).clamp(SHORTEST, 1.0);
        let duration = (duration.exp() * shorter).max(1.0);
        let left = self.steps.saturating_sub(self.step + 1) as f64;
        let too_large = (stall_threshold + stall_slope * (1.0 - self.progress)).exp();
        let is_stalled = self.seen.is_some_and(|seen| seen.least > too_large);
        let restarts = is_stalled && left > reserve.exp() * duration;
        if restarts {
            (self.progress, self.seen) = (0.0, None);
        }
        self.step += 1;
        let progress = (self.progress * LEVELS).round() / LEVELS;
        let next = AdaptiveStep { progress, rate: (rate_end * progress).exp() / shorter, restarts };
        let trend =
            self.seen.map_or(0.0, |seen| ((seen.recent + SMALL) / (seen.earlier + SMALL)).ln());
        // The last step of a run is at progress 1.
        let pace = ((patience * trend).exp() / duration).max((1.0 - self.progress) / (left + 1.0));
        self.progress = (self.progress + pace).min(1.0);
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The steps of a run with these errors.
    fn run(
        schedule: AdaptiveSchedule,
        count: usize,
        error: impl Fn(usize) -> f64,
    ) -> Vec<AdaptiveStep> {
        let mut controller = schedule.controller(count);
        (0..count).map(|step| controller.next(step.checked_sub(1).map(&error))).collect()
    }

    #[test]
    fn a_run_that_fits_goes_to_the_end_and_stays_there() {
        let steps = run(AdaptiveSchedule::START, 300, |_| 0.01);
        assert_eq!(steps[0], AdaptiveStep { progress: 0.0, rate: 1.0, restarts: false });
        assert_eq!(steps[299].progress, 1.0);
        assert!(steps.windows(2).all(|two| two[0].progress <= two[1].progress && !two[1].restarts));
        let arrived = steps.iter().position(|step| step.progress >= 1.0).unwrap();
        assert!((99..102).contains(&arrived), "{arrived}");
    }

    #[test]
    fn a_stalled_run_restarts_while_enough_steps_are_left() {
        let restarts = |error: f64| {
            let steps = run(AdaptiveSchedule::START, 300, |_| error);
            assert!(steps[299].progress > 0.95);
            let found = (0..300).filter(|&k| steps[k].restarts).collect::<Vec<_>>();
            assert!(found.iter().all(|&k| steps[k].progress == 0.0));
            found
        };
        let (late, early) = (restarts(0.051), restarts(0.5));
        assert!(late.len() == 2 && (99..103).contains(&late[0]), "{late:?}");
        // exp(3 (1 - progress) - 3) is below a half from a progress of 0.23 on.
        assert!(early.len() > 7 && (22..26).contains(&early[0]), "{early:?}");
    }

    #[test]
    fn a_shorter_run_goes_the_same_way_in_larger_steps() {
        let [long, short] = [300, 150].map(|steps| run(AdaptiveSchedule::START, steps, |_| 0.051));
        let restarts = |steps: &[AdaptiveStep]| steps.iter().filter(|step| step.restarts).count();
        assert_eq!((restarts(&long), restarts(&short)), (2, 2));
        let rate = |steps| run(AdaptiveSchedule::START, steps, |_| 0.01)[0].rate;
        assert_eq!([300, 150, 30, 900].map(rate), [1.0, 2.0, 2.0, 1.0]);
    }

    #[test]
    fn a_run_waits_while_its_error_falls() {
        let patient = AdaptiveSchedule { patience: 2.0, ..AdaptiveSchedule::START };
        let falls = |step: usize| 0.9_f64.powi(step as i32);
        let [waits, goes] =
            [patient, AdaptiveSchedule::START].map(|one| run(one, 300, falls)[60].progress);
        assert!(waits < 0.5 * goes, "{waits} and {goes}");
    }

    #[test]
    fn progress_and_rate_are_finite_for_any_error() {
        for size in [-80.0, 0.0, 80.0] {
            let extreme = AdaptiveSchedule::START.with([size; AdaptiveSchedule::PARAMETERS]);
            for steps in [1, 2, 300] {
                for error in [0.0, 1e-300, 0.5, 1e300, f64::NAN, f64::INFINITY] {
                    for step in run(extreme, steps, |_| error) {
                        assert!((0.0..=1.0).contains(&step.progress), "{step:?}");
                        assert!(step.rate.is_finite() && step.rate > 0.0, "{step:?}");
                    }
                }
            }
        }
    }
}
