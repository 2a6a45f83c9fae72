use crate::{Description, ErrorGroup, Point, Run, best_step, median, quantity::Quantity};

/// Width and height of an image in NDC.
const IMAGE: f64 = 2.0;
/// A soft and a hard image whose errors differ by less than this share are the same image.
const SAME: f64 = 1e-6;
/// The end is worse than the best step where its error is larger by this share and this much.
const WORSE: [f64; 2] = [0.05, 2e-3];

/// What curves say about the choice of the softness, a line each; said once for all runs.
///
/// A softness wider than the image; no pixel in the soft band, so that an image has no gradient; a
/// decay that went on past the best step.
pub(crate) fn guidance(description: &Description, score: Quantity, runs: &[Run]) -> Vec<String> {
    let says = [
        too_wide(description, runs),
        too_narrow(description, score, runs),
        past_the_best(score, runs),
    ];
    says.into_iter().flatten().collect()
}

/// Width of the softness in NDC at a point.
fn width(description: &Description, point: &Point) -> f64 {
    let squared = description.settings.get("squared").and_then(serde_json::Value::as_bool);
    if squared == Some(true) { point.scale.sqrt() } else { point.scale }
}

fn too_wide(description: &Description, runs: &[Run]) -> Option<String> {
    let first = runs.first()?.curve.first()?;
    let width = width(description, first);
    (width > IMAGE).then(|| {
        format!(
            "the softness is wider than the image, which is {IMAGE} wide: its scale starts at {:.3e}, so \
             that every face reaches every pixel and the image shows little: try a smaller --scale",
            first.scale
        )
    })
}

fn too_narrow(description: &Description, score: Quantity, runs: &[Run]) -> Option<String> {
    let hard = match score {
        Quantity::Extra(place) => description.extra.get(place)?,
        _ => return None,
    };
    if hard.key != "hard" || hard.group != ErrorGroup::Image {
        return None;
    }
    // With a surrogate an image without a band has a gradient.
    let felt = description.settings.get("surrogate_scale").and_then(serde_json::Value::as_f64);
    let still = runs.iter().filter(|run| has_no_band(score, &run.curve, felt.is_some())).count();
    let first = runs.first()?.curve.first()?;
    let (flag, scale) = felt.map_or(("scale", first.scale), |scale| ("surrogate-scale", scale));
    (still > 0).then(|| {
        format!(
            "no pixel lies in the soft band{}: the soft image is the hard one, and has no gradient. The \
             scale {scale:.3e} is too narrow for pixels that are {:.3} wide: try a larger --{flag}",
            of_runs(still, runs.len()),
            IMAGE / description.size as f64
        )
    })
}

/// Whether the soft image is the hard one at the start, or at most steps, and so nothing can move; with a
/// surrogate, whether nothing does.
fn has_no_band(score: Quantity, curve: &[Point], has_surrogate: bool) -> bool {
    let sharp = |place: &usize| {
        let point = &curve[*place];
        let (soft, hard) = (point.image_error, score.of(point));
        let same = (soft - hard).abs() <= SAME * hard.abs();
        // Images that do not meet their target have the same error too, but may still move.
        let stays =
            curve.get(place + 1).is_none_or(|next| next.parameter_error == point.parameter_error);
        same && (hard < 1.0 && !has_surrogate || stays)
    };
    let steps = curve.len().saturating_sub(1);
    let count = (0..steps).filter(sharp).count();
    steps > 0 && hard_enough(score, curve) && (sharp(&0) || 2 * count > steps)
}

/// Whether there is an error left that a gradient could lower.
fn hard_enough(score: Quantity, curve: &[Point]) -> bool {
    curve.last().is_some_and(|last| score.of(last) > 0.0)
}

fn past_the_best(score: Quantity, runs: &[Run]) -> Option<String> {
    let passed: Vec<&Point> = runs.iter().filter_map(|run| passed(score, &run.curve)).collect();
    if 2 * passed.len() <= runs.len() {
        return None;
    }
    let of =
        |value: fn(&Point) -> f64| median(&passed.iter().map(|p| value(p)).collect::<Vec<_>>());
    let scale = of(|point| point.scale);
    Some(format!(
        "the decay goes on past the best step{}, which is what is returned: step {}, where the scale is \
         {scale:.2e}: try --scale-end {scale:.1e}",
        of_runs(passed.len(), runs.len()),
        of(|point| point.step as f64)
    ))
}

/// The best step of a run whose scale falls after it, to no good: the last tenth of the steps is
/// worse throughout, because single steps are noise.
fn passed(score: Quantity, curve: &[Point]) -> Option<&Point> {
    let tenth = &curve[curve.len() - curve.len().div_ceil(10)..];
    let best_of = |points| best_step(points, |point| score.of(point));
    let (best, last) = (best_of(curve)?, best_of(tenth)?);
    let [share, much] = WORSE;
    let worse = score.of(last) > (1.0 + share) * score.of(best) + much;
    (worse && last.scale < best.scale).then_some(best)
}

fn of_runs(count: usize, all: usize) -> String {
    if all == 1 { String::new() } else { format!(" in {count} of {all} runs") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ExtraError, Measure};

    const NONE: Measure = Measure { name: "error", unit: "" };

    fn description() -> Description {
        Description {
            softness: "logistic".into(),
            parameters: 1,
            backend: String::new(),
            steps: 2,
            size: 32,
            faces: 1,
            runs: 1,
            image_error: NONE,
            parameter_error: NONE,
            extra: vec![ExtraError { group: ErrorGroup::Image, key: "hard", measure: NONE }],
            success: String::new(),
            settings: serde_json::Map::new(),
        }
    }

    /// What is said of a run with these soft errors, hard errors and scales.
    fn said(points: [[f64; 3]; 3]) -> Vec<String> {
        said_of(&description(), points, 0.0)
    }

    /// Likewise, where the parameter error falls by this much at each step.
    fn said_of(description: &Description, points: [[f64; 3]; 3], falls: f64) -> Vec<String> {
        let point = |(step, [soft, hard, scale]): (usize, [f64; 3])| Point {
            step,
            loss: soft,
            image_error: soft,
            parameter_error: 5.0 - falls * step as f64,
            scale,
            extra: vec![hard],
        };
        let curve = points.into_iter().enumerate().map(point).collect();
        let (seed, success, step_seconds) = (0, true, Vec::new());
        let run = Run { seed, curve, success, step_seconds, pictures: None, warnings: Vec::new() };
        guidance(description, Quantity::Extra(0), &[run])
    }

    #[test]
    fn a_sound_run_is_not_commented_on() {
        let sound = [[0.5, 0.4, 0.1], [0.3, 0.2, 0.05], [0.2, 0.1, 0.02]];
        assert_eq!(said(sound), [""; 0]);
    }

    #[test]
    fn a_softness_wider_than_the_image_is_told_once() {
        let lines = said([[0.5, 0.4, 3.0]; 3]);
        assert!(lines.len() == 1 && lines[0].contains("wider than the image"), "{lines:?}");
    }

    #[test]
    fn an_image_without_a_soft_band_is_told_once() {
        let lines = said([[0.4, 0.4, 1e-9]; 3]);
        assert!(lines.len() == 1 && lines[0].contains("no pixel lies"), "{lines:?}");
        // Nothing is drawn where the target is, and nothing moves.
        let lines = said([[1.0, 1.0, 1e-9]; 3]);
        assert!(lines.len() == 1 && lines[0].contains("no pixel lies"), "{lines:?}");
    }

    #[test]
    fn with_a_surrogate_an_image_may_be_hard_as_long_as_something_moves() {
        let mut both = description();
        both.settings.insert("surrogate_scale".into(), 1e-8.into());
        let points = [[0.4, 0.4, 1e-9]; 3];
        assert_eq!(said_of(&both, points, 1.0), [""; 0]);
        let lines = said_of(&both, points, 0.0);
        assert!(lines.len() == 1 && lines[0].contains("larger --surrogate-scale"), "{lines:?}");
        assert_eq!(said_of(&description(), points, 1.0).len(), 1);
    }

    #[test]
    fn a_decay_past_the_best_step_names_the_scale_to_end_at() {
        let lines = said([[0.5, 0.4, 0.1], [0.3, 0.1, 0.01], [0.6, 0.5, 1e-5]]);
        assert!(lines.len() == 1 && lines[0].contains("try --scale-end 1.0e-2"), "{lines:?}");
        // The same without a decay is noise.
        assert!(said([[0.5, 0.4, 0.1], [0.3, 0.1, 0.1], [0.6, 0.5, 0.1]]).is_empty());
    }
}
