use std::fmt::Write;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use crate::{Run, task::Point};

/// A [`Run`] without pictures, as it stands in a journal.
#[derive(Serialize, Deserialize)]
struct Stored {
    seed: u64,
    success: bool,
    warnings: Vec<String>,
    step_seconds: Vec<f64>,
    curve: Vec<String>,
}

/// Writes runs; their pictures are not among it.
pub(crate) fn serialize<S: Serializer>(runs: &[Run], serializer: S) -> Result<S::Ok, S::Error> {
    let stored = runs.iter().map(|run| Stored {
        seed: run.seed,
        success: run.success,
        warnings: run.warnings.clone(),
        step_seconds: run.step_seconds.clone(),
        curve: run.curve.iter().map(text).collect(),
    });
    serializer.collect_seq(stored)
}

/// Reads what [`serialize`] wrote.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(source: D) -> Result<Vec<Run>, D::Error> {
    let run = |stored: Stored| {
        let curve = stored.curve.iter().map(|text| point(text)).collect::<Option<Vec<_>>>();
        Some(Run {
            seed: stored.seed,
            curve: curve.filter(|curve| !curve.is_empty())?,
            success: stored.success,
            step_seconds: stored.step_seconds,
            pictures: None,
            warnings: stored.warnings,
        })
    };
    let runs = Vec::<Stored>::deserialize(source)?.into_iter().map(run);
    runs.collect::<Option<_>>().ok_or_else(|| D::Error::custom("a curve cannot be read"))
}

/// The numbers of a point as text, because `serde_json` reads numbers with the last digit off unless
/// a feature is on that all its users would have to compile.
fn text(point: &Point) -> String {
    let Point { step, loss, image_error, parameter_error, scale, ref extra } = *point;
    let mut text = format!("{step} {loss} {image_error} {parameter_error} {scale}");
    for number in extra {
        // Writing to a string does not fail.
        let _ = write!(text, " {number}");
    }
    text
}

fn point(text: &str) -> Option<Point> {
    let (step, numbers) = text.split_once(' ')?;
    let numbers: Vec<f64> = numbers.split(' ').map(|x| x.parse().ok()).collect::<Option<_>>()?;
    let (&[loss, image_error, parameter_error, scale], extra) = numbers.split_first_chunk()?;
    let (step, extra) = (step.parse().ok()?, extra.to_vec());
    Some(Point { step, loss, image_error, parameter_error, scale, extra })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize, Deserialize)]
    struct Runs(#[serde(with = "super")] Vec<Run>);

    #[test]
    fn a_run_comes_back_bit_for_bit() {
        let point = |step: usize| Point {
            step,
            loss: 0.1 + 0.2,
            image_error: 1.0 / 3.0,
            parameter_error: f64::MIN_POSITIVE,
            scale: 1e-300 / 7.0,
            extra: vec![-0.0, 12345.678901234567],
        };
        let run = Run {
            seed: u64::MAX,
            curve: vec![point(0), point(1)],
            success: true,
            step_seconds: vec![0.5],
            pictures: None,
            warnings: vec!["one".into()],
        };
        let text = serde_json::to_string(&Runs(vec![run.clone()])).unwrap();
        let Runs(again) = serde_json::from_str(&text).unwrap();
        assert_eq!(again[0].curve, run.curve);
        assert_eq!((again[0].seed, again[0].success), (u64::MAX, true));
        assert_eq!(again[0].warnings, run.warnings);
    }

    #[test]
    fn a_broken_point_is_refused() {
        for broken in ["", "1", "1 2 3 4", "x 1 2 3 4", "1 2 3 4 y"] {
            assert!(point(broken).is_none(), "{broken}");
        }
        assert!(point("1 2 3 4 5").is_some());
    }
}
