use rand::{Rng, SeedableRng, rngs::StdRng};

/// Arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Middle value; between two, their mean. NaN of nothing.
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Value below which the fraction `q` of the values lies, interpolated linearly between them.
///
/// With the `n` values sorted, that is position `q (n - 1)`; NaN of nothing. The order of the
/// values does not matter. NaN among them sorts last.
///
/// # Panics
///
/// If `q` is not in [0, 1].
pub fn quantile(values: &[f64], q: f64) -> f64 {
    assert!((0.0..=1.0).contains(&q), "a quantile needs a fraction in [0, 1], not {q}");
    let Some(last) = values.len().checked_sub(1) else {
        return f64::NAN;
    };
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let position = q * last as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (sorted[above] - sorted[below]) * (position - below as f64)
}

/// Samples behind the confidence interval of a result.
const RESAMPLES: usize = 10_000;

/// 95 % interval of a mean, as all results have it: `[low, high]`. One value gives an interval of no width; none gives NaN.
pub fn mean_interval(values: &[f64]) -> [f64; 2] {
    mean_intervals(&[values.to_vec()], RESAMPLES)[0]
}

/// 95 % intervals of the means of lists of one length, by the percentile bootstrap with the same samples for all.
///
/// Draws `resamples` samples of that length with replacement, and gives the 2.5 % and 97.5 % quantiles of their means.
pub(crate) fn mean_intervals(lists: &[Vec<f64>], resamples: usize) -> Vec<[f64; 2]> {
    let count = lists.first().map_or(0, Vec::len);
    if count == 0 {
        return vec![[f64::NAN; 2]; lists.len()];
    }
    let mut random = StdRng::seed_from_u64(0);
    let mut means = vec![Vec::with_capacity(resamples); lists.len()];
    for _ in 0..resamples {
        let drawn: Vec<usize> = (0..count).map(|_| random.random_range(0..count)).collect();
        for (list, means) in lists.iter().zip(&mut means) {
            means.push(drawn.iter().map(|&place| list[place]).sum::<f64>() / count as f64);
        }
    }
    means.iter().map(|means| [0.025, 0.975].map(|q| quantile(means, q))).collect()
}

/// 95 % interval of a rate of which `successes` of `trials` were seen: `[low, high]`.
///
/// Source: Wilson 1927, the score interval, with z = 1.96: it stays in [0, 1] and is of use for a
/// few trials and for rates near 0 or 1. No trials give [0, 1].
pub fn wilson_interval(successes: usize, trials: usize) -> [f64; 2] {
    /// 97.5 % quantile of the normal distribution.
    const Z: f64 = 1.959_963_984_540_054;
    if trials == 0 {
        return [0.0, 1.0];
    }
    let (n, rate) = (trials as f64, successes as f64 / trials as f64);
    let shrink = 1.0 + Z * Z / n;
    let centre = (rate + Z * Z / (2.0 * n)) / shrink;
    let half = Z * (rate * (1.0 - rate) / n + Z * Z / (4.0 * n * n)).sqrt() / shrink;
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_between_sorted_values() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(median(&values), 2.5);
        assert_eq!(quantile(&values, 0.25), 1.75);
        assert_eq!(quantile(&values, 0.0), 1.0);
        assert_eq!(quantile(&values, 1.0), 4.0);
        assert_eq!(median(&[7.0]), 7.0);
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn wilson_interval_matches_hand_worked_values() {
        // 8 of 10: z² = 3.841459, centre 0.992073 / 1.384146, half width 0.313705 / 1.384146.
        let [low, high] = wilson_interval(8, 10);
        assert!((low - 0.490162).abs() < 1e-6, "{low}");
        assert!((high - 0.943318).abs() < 1e-6, "{high}");
        // None of 20: low is 0, high is z² / (20 + z²).
        let [low, high] = wilson_interval(0, 20);
        assert!(low.abs() < 1e-15 && (high - 0.161125).abs() < 1e-6, "{low} {high}");
        assert_eq!(wilson_interval(24, 24)[1], 1.0);
        assert_eq!(wilson_interval(0, 0), [0.0, 1.0]);
    }

    #[test]
    fn bootstrap_interval_of_two_values_is_their_range() {
        // Means are 0, 1/2 and 1 with probabilities 1/4, 1/2 and 1/4.
        assert_eq!(mean_interval(&[0.0, 1.0]), [0.0, 1.0]);
        assert_eq!(mean_interval(&[3.0]), [3.0, 3.0]);
    }

    #[test]
    fn bootstrap_interval_of_many_values_nears_the_normal_one() {
        let values: Vec<f64> = (0..400).map(|k| (k % 2) as f64).collect();
        // Standard error is 0.5 / sqrt(400) = 0.025.
        let [low, high] = mean_interval(&values);
        assert!((low - (0.5 - 0.049)).abs() < 0.003, "{low}");
        assert!((high - (0.5 + 0.049)).abs() < 0.003, "{high}");
        assert_eq!(mean_intervals(&[vec![0.0; 400], values], 10_000)[1], [low, high]);
    }
}
