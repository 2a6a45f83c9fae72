use serde::{Deserialize, Serialize};
use softrast_softness::Softness;
use softrast_tensor::{Backend, Tensor};

use crate::softness_file::stored::LARGEST_LOGARITHM;

/// Width of a softness over a run: at progress t, s is evaluated at `d / scale(t)`.
///
/// `scale(t) = floor + exp(l(t))`, where `l` interpolates the knots linearly. The scale therefore
/// stays above the floor, which is given in pixels because the pixel is the resolution of an image,
/// and its gradient never vanishes, as it would under a hard limit.
///
/// Not in the paper, whose softness is the same at every step: a wide softness has a gradient far
/// from the edges of the target, a narrow one a sharp image, and a run needs one after the other.
///
/// ```
/// use softrast_inverse::{ScaleSchedule, ScheduledSoftness};
/// use softrast_softness::{EdgeSoftness, Family};
///
/// let schedule = ScaleSchedule { knots: [0.1_f64, 0.001].map(f64::ln).into(), floor_px: 0.5 };
/// let unit = ScheduledSoftness::constant(EdgeSoftness::new(Family::Logistic), 1.0);
/// let floor = schedule.floor(&unit.softness, 64);
/// assert_eq!(floor, 0.5 / 32.0);
/// let softness = ScheduledSoftness { schedule: Some(schedule), ..unit };
/// assert!((softness.scale_at(0.5, 64) - floor - 0.01).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleSchedule {
    /// Logarithms of the scale above the floor at evenly spaced progress, the first at the first
    /// step and the last at the last; in NDC, or NDC² if the softness is squared.
    pub knots: Vec<f64>,
    /// Floor of the scale, in pixels, 0 to 1e6.
    pub floor_px: f64,
}

/// Most knots of a schedule.
const MOST_KNOTS: usize = 16;
/// Largest floor in pixels, so that its square in NDC fits an f32.
const LARGEST_FLOOR_PX: f64 = 1e6;

impl ScaleSchedule {
    /// The progress of a run at `step` of `steps`, 0 to 1: the last gradient is taken at 1.
    pub fn progress(step: usize, steps: usize) -> f64 {
        let last = steps.saturating_sub(1).max(1);
        step.min(last) as f64 / last as f64
    }

    /// The floor in the unit of the scale of `softness`, on images of `size` × `size` pixels.
    pub fn floor(&self, softness: &impl Softness, size: usize) -> f64 {
        let width = self.floor_px * 2.0 / size as f64;
        if softness.scale_is_squared() { width * width } else { width }
    }

    /// The scale `[1]` at `progress` of a run, 0 to 1, for these `knots` `[K]` and `floor`.
    ///
    /// # Panics
    ///
    /// If there is no knot, or `progress` is not in [0, 1].
    pub fn scale<B: Backend>(knots: &Tensor<B, 1>, floor: f64, progress: f64) -> Tensor<B, 1> {
        let ([before, after], share) = between(knots.dims()[0], progress);
        let low = knots.clone().narrow(0, before, 1);
        let high = knots.clone().narrow(0, after, 1);
        (low * (1.0 - share) + high * share).exp() + floor
    }

    /// [`ScaleSchedule::scale`] of its own knots above this floor, as a plain number.
    pub(crate) fn at(&self, floor: f64, progress: f64) -> f64 {
        let ([before, after], share) = between(self.knots.len(), progress);
        (self.knots[before] * (1.0 - share) + self.knots[after] * share).exp() + floor
    }

    /// Returns the found and the expected value if it is invalid.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Self { knots, floor_px } = self;
        if !(1..=MOST_KNOTS).contains(&knots.len()) {
            return Err(format!("{} knots, expected 1 to {MOST_KNOTS}", knots.len()));
        }
        if let Some(knot) = knots.iter().find(|k| k.is_nan() || k.abs() > LARGEST_LOGARITHM) {
            let limit = LARGEST_LOGARITHM;
            return Err(format!("a knot of {knot}, expected -{limit} to {limit}"));
        }
        if !(0.0..=LARGEST_FLOOR_PX).contains(floor_px) {
            let limit = LARGEST_FLOOR_PX;
            return Err(format!("a floor of {floor_px} pixels, expected 0 to {limit}"));
        }
        Ok(())
    }
}

/// The two knots of `count` around `progress` of a run, and the weight of the second.
fn between(count: usize, progress: f64) -> ([usize; 2], f64) {
    assert!(count > 0, "a schedule has at least one knot");
    assert!((0.0..=1.0).contains(&progress), "progress {progress} of a run is not in [0, 1]");
    let place = progress * (count - 1) as f64;
    let before = (place as usize).min(count.saturating_sub(2));
    ([before, (before + 1).min(count - 1)], place - before as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_gradient_of_a_run_is_taken_at_its_end() {
        let progresses = |steps| [0, 1, 9, 10].map(|step| ScaleSchedule::progress(step, steps));
        assert_eq!(progresses(10), [0.0, 1.0 / 9.0, 1.0, 1.0]);
        assert_eq!(ScaleSchedule::progress(0, 1), 0.0);
    }
}
