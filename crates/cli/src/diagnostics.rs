use softrast_inverse::{ScheduledSoftness, Surrogate};
use softrast_lab::{Point, Run, best_point, median};
use softrast_softness::Softness;

use crate::task::{HARD, PARAMETER, SCALE, SOFT};

/// Width and height of an image in NDC.
const IMAGE: f64 = 2.0;
/// Soft and hard images with a relative difference of their errors below this are taken as equal.
const SAME: f64 = 1e-6;
/// The end is worse than the best step if its error is larger by this share plus this amount.
const WORSE: [f64; 2] = [0.05, 2e-3];

/// Warnings about the choice of the softness, from the curves of all runs on images of `size` × `size` pixels; each at most once.
///
/// A softness wider than the image; no pixel in the soft band, so that images have no gradient; a decay that went on past the best step.
pub(crate) fn diagnostics(softness: &ScheduledSoftness, size: usize, runs: &[Run]) -> Vec<String> {
    let surrogate = softness.surrogate_at(0.0, size);
    let surrogate = surrogate.map(|Surrogate { softness, phi }| softness.scale(&phi));
    let found = [
        too_wide(softness.softness.scale_is_squared(), runs),
        too_narrow(surrogate, size, runs),
        past_the_best(runs),
    ];
    found.into_iter().flatten().collect()
}

fn too_wide(squared: bool, runs: &[Run]) -> Option<String> {
    let scale = runs.first()?.curve.first()?.values[SCALE];
    let width = if squared { scale.sqrt() } else { scale };
    (width > IMAGE).then(|| {
        format!(
            "the softness is wider than the image, which is {IMAGE} wide: its scale starts at {scale:.3e}, so that every face reaches \
             every pixel and the image shows little: try a smaller --scale"
        )
    })
}

fn too_narrow(surrogate: Option<f64>, size: usize, runs: &[Run]) -> Option<String> {
    let still = runs.iter().filter(|run| has_no_band(&run.curve, surrogate.is_some())).count();
    let first = runs.first()?.curve.first()?.values[SCALE];
    // With a surrogate, an image without a soft band has a gradient.
    let (flag, scale) = surrogate.map_or(("scale", first), |scale| ("surrogate-scale", scale));
    (still > 0).then(|| {
        format!(
            "no pixel lies in the soft band{}: the soft image is the hard one, and has no gradient. The scale {scale:.3e} is too \
             narrow for pixels that are {:.3} wide: try a larger --{flag}",
            of_runs(still, runs.len()),
            IMAGE / size as f64
        )
    })
}

/// Whether the soft image equals the hard one at the start, or at most steps, so that nothing can
/// move; with a surrogate, only if nothing moves.
fn has_no_band(curve: &[Point], has_surrogate: bool) -> bool {
    let sharp = |place: &usize| {
        let point = &curve[*place].values;
        let (soft, hard) = (point[SOFT], point[HARD]);
        let same = (soft - hard).abs() <= SAME * hard.abs();
        // Images that do not overlap their target have equal errors too, but may still move.
        let next = curve.get(place + 1);
        let stays = next.is_none_or(|next| next.values[PARAMETER] == point[PARAMETER]);
        same && (hard < 1.0 && !has_surrogate || stays)
    };
    let steps = curve.len().saturating_sub(1);
    let count = (0..steps).filter(sharp).count();
    let wrong = curve.last().is_some_and(|last| last.values[HARD] > 0.0);
    steps > 0 && wrong && (sharp(&0) || 2 * count > steps)
}

fn past_the_best(runs: &[Run]) -> Option<String> {
    let passed: Vec<&Point> = runs.iter().filter_map(|run| passed(&run.curve)).collect();
    if 2 * passed.len() <= runs.len() {
        return None;
    }
    let scales: Vec<f64> = passed.iter().map(|point| point.values[SCALE]).collect();
    let steps: Vec<f64> = passed.iter().map(|point| point.step as f64).collect();
    let (scale, step) = (median(&scales), median(&steps));
    Some(format!(
        "the decay goes on past the best step{}, which is what is returned: step {step}, where the scale is {scale:.2e}: try \
         --scale-end {scale:.1e}",
        of_runs(passed.len(), runs.len()),
    ))
}

/// The best step of a run whose scale falls after it without improving: the whole last tenth of the
/// steps is worse. Single steps are noisy.
fn passed(curve: &[Point]) -> Option<&Point> {
    let tenth = &curve[curve.len() - curve.len().div_ceil(10)..];
    let (best, last) = (best_point(curve, HARD)?, best_point(tenth, HARD)?);
    let [share, much] = WORSE;
    let worse = last.values[HARD] > (1.0 + share) * best.values[HARD] + much;
    (worse && last.values[SCALE] < best.values[SCALE]).then_some(best)
}

fn of_runs(count: usize, all: usize) -> String {
    if all == 1 { String::new() } else { format!(" in {count} of {all} runs") }
}

#[cfg(test)]
mod tests {
    use softrast_softness::{EdgeSoftness, Family};

    use super::*;

    /// The warnings for a run with these soft errors, hard errors and scales, whose parameter error falls by this much at each step.
    fn found(surrogate: bool, points: [[f64; 3]; 3], falls: f64) -> Vec<String> {
        let point = |(step, [soft, hard, scale]): (usize, [f64; 3])| {
            let values = vec![soft, soft, 5.0 - falls * step as f64, scale, hard];
            Point { step, values }
        };
        let curve = points.into_iter().enumerate().map(point).collect();
        let run = Run { curve, ..Run::default() };
        let edge = EdgeSoftness::new(Family::Logistic);
        let softness = ScheduledSoftness::constant(edge, 1e-8);
        let softness = if surrogate { softness.with_surrogate_scale(1e-8) } else { softness };
        diagnostics(&softness, 32, &[run])
    }

    fn one(lines: &[String], part: &str) {
        assert!(lines.len() == 1 && lines[0].contains(part), "{lines:?}");
    }

    #[test]
    fn a_sound_run_is_not_commented_on() {
        let sound = [[0.5, 0.4, 0.1], [0.3, 0.2, 0.05], [0.2, 0.1, 0.02]];
        assert_eq!(found(false, sound, 0.0), [""; 0]);
    }

    #[test]
    fn a_softness_wider_than_the_image_is_told_once() {
        one(&found(false, [[0.5, 0.4, 3.0]; 3], 0.0), "wider than the image");
    }

    #[test]
    fn an_image_without_a_soft_band_is_told_once() {
        one(&found(false, [[0.4, 0.4, 1e-9]; 3], 0.0), "no pixel lies");
        // Nothing is drawn at the target, and nothing moves.
        one(&found(false, [[1.0, 1.0, 1e-9]; 3], 0.0), "no pixel lies");
    }

    #[test]
    fn with_a_surrogate_an_image_may_be_hard_as_long_as_something_moves() {
        let points = [[0.4, 0.4, 1e-9]; 3];
        assert_eq!(found(true, points, 1.0), [""; 0]);
        one(&found(true, points, 0.0), "larger --surrogate-scale");
        assert_eq!(found(false, points, 1.0).len(), 1);
    }

    #[test]
    fn a_decay_past_the_best_step_names_the_scale_to_end_at() {
        let lines = found(false, [[0.5, 0.4, 0.1], [0.3, 0.1, 0.01], [0.6, 0.5, 1e-5]], 0.0);
        one(&lines, "try --scale-end 1.0e-2");
        // Without a decay this is noise.
        let still = [[0.5, 0.4, 0.1], [0.3, 0.1, 0.1], [0.6, 0.5, 0.1]];
        assert!(found(false, still, 0.0).is_empty());
    }
}
