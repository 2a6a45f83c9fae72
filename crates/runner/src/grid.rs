use serde::Serialize;
use serde_json::{Map, Value};

/// What `search` tries.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Grid {
    /// Scales of a static softness, in NDC (NDC² with `--squared`), ascending; every pair of a wider
    /// and a narrower one is a decay. Empty where the task has no scale.
    pub scales: Vec<f64>,
    /// Learning rates, ascending. Empty where the task has none.
    pub learning_rates: Vec<f64>,
    /// A number that only this task has. The task finds the value to try in [`Settings::own`].
    ///
    /// [`Settings::own`]: crate::Settings::own
    pub own: Option<OwnAxis>,
    /// Values of the fine grid between the best value and each of its neighbours, evenly spaced in
    /// the logarithm.
    pub fine: usize,
    /// Training seeds that every setting is tried on.
    pub runs: usize,
}

/// Values to try for a flag of the task, as they stand on the command line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OwnAxis {
    /// The flag without dashes, such as `depth-scale`.
    pub flag: &'static str,
    /// Values, ascending and positive.
    pub values: Vec<f64>,
}

/// Ratio of neighbours where nothing asks for another: half a decade.
const RATIO: f64 = 3.162_277_660_168_379_5;

/// Most steps from the last scale of the default decay to its first.
const STEPS: f64 = 4.0;

impl Grid {
    /// Around the numbers `scale`, `scale_end` and `learning_rate` of a task's settings.
    ///
    /// Learning rates are the task's own and one on either side. Scales go from one below the
    /// narrower of the task's two to the wider, or two to either side if they are the same. Neighbours
    /// are half a decade apart, as widths in NDC: a decade if `squared` is true. A number that is
    /// missing leaves its list empty. Every setting is tried on 8 seeds, and the fine grid halves
    /// the distances.
    pub fn around(settings: &Map<String, Value>) -> Self {
        let number = |key: &str| settings.get(key).and_then(Value::as_f64).filter(|x| *x > 0.0);
        let squared = settings.get("squared").and_then(Value::as_bool) == Some(true);
        let ratio = if squared { RATIO * RATIO } else { RATIO };
        let scales = number("scale").map_or_else(Vec::new, |scale| {
            let end = number("scale_end").unwrap_or(scale);
            let (low, high) = (scale.min(end), scale.max(end));
            let steps = ((high / low).ln() / ratio.ln() - 1e-9).ceil().min(STEPS);
            if steps < 1.0 {
                return geometric(low, ratio, -2..=2);
            }
            geometric(low, (high / low).powf(1.0 / steps), -1..=steps as i32)
        });
        let rates = number("learning_rate");
        let learning_rates = rates.map_or_else(Vec::new, |rate| geometric(rate, RATIO, -1..=1));
        Self { scales, learning_rates, own: None, fine: 1, runs: 8 }
    }
}

fn geometric(from: f64, ratio: f64, steps: std::ops::RangeInclusive<i32>) -> Vec<f64> {
    steps.map(|k| rounded(from * ratio.powi(k))).collect()
}

/// To three digits, so that a value found can be typed.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().expect("a printed number can be read")
}

/// Values of the fine grid around `best`, one of the ascending `coarse`; itself among them.
///
/// Beyond the first and the last of `coarse` they go on as on the other side.
pub(crate) fn fine(coarse: &[f64], best: f64, between: usize) -> Vec<f64> {
    let at = coarse.iter().position(|&x| x == best);
    let ratio =
        |low: Option<usize>, high: Option<usize>| Some(coarse.get(high?)? / coarse.get(low?)?);
    let up = ratio(at, at.map(|k| k + 1));
    let down = ratio(at.and_then(|k| k.checked_sub(1)), at);
    let (Some(up), Some(down)) = (up.or(down), down.or(up)) else {
        return vec![best];
    };
    let steps = between as i32 + 1;
    let part = |ratio: f64, k: i32| rounded(best * ratio.powf(f64::from(k) / f64::from(steps)));
    let below = (1..steps).rev().map(|k| part(down, -k));
    let above = (1..steps).map(|k| part(up, k));
    below.chain([best]).chain(above).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn around(settings: &Value) -> Grid {
        Grid::around(settings.as_object().unwrap())
    }

    #[test]
    fn the_settings_of_the_task_lie_in_its_grid() {
        let grid = around(&json!({"scale": 0.03, "scale_end": 0.002, "learning_rate": 0.3}));
        assert_eq!(grid.scales, [0.000811, 0.002, 0.00493, 0.0122, 0.03]);
        assert_eq!(grid.learning_rates, [0.0949, 0.3, 0.949]);
        let grid = around(&json!({"scale": 0.01, "scale_end": 0.01}));
        assert_eq!(grid.scales, [0.001, 0.00316, 0.01, 0.0316, 0.1]);
        assert!(grid.learning_rates.is_empty());
    }

    #[test]
    fn a_squared_scale_moves_by_squared_steps() {
        let grid = around(&json!({"scale": 1e-4, "squared": true}));
        assert_eq!(grid.scales, [1e-6, 1e-5, 1e-4, 1e-3, 1e-2]);
    }

    #[test]
    fn the_fine_grid_lies_between_the_neighbours_and_goes_on_beyond_an_end() {
        let coarse = [0.01, 0.1, 10.0];
        assert_eq!(fine(&coarse, 0.1, 1), [0.0316, 0.1, 1.0]);
        assert_eq!(fine(&coarse, 10.0, 1), [1.0, 10.0, 100.0]);
        assert_eq!(fine(&[1e-3, 1.0, 1e3], 1.0, 2), [0.01, 0.1, 1.0, 10.0, 100.0]);
        assert_eq!(fine(&[0.5], 0.5, 2), [0.5]);
        assert_eq!(fine(&coarse, 0.1, 0), [0.1]);
    }
}
