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

/// 95 % interval of the mean by the percentile bootstrap: `[low, high]`.
///
/// Draws `resamples` samples of the same length with replacement, and gives the 2.5 % and 97.5 %
/// quantiles of their means. One value gives an interval of no width; none gives NaN.
pub fn bootstrap_mean_interval(values: &[f64], resamples: usize, seed: u64) -> [f64; 2] {
    Resampling::new(values.len(), resamples, seed).mean_interval(values)
}

/// Samples with replacement that are drawn once, for many lists of the same length.
pub(crate) struct Resampling {
    values: usize,
    /// Places in the list, one row of `values` per sample.
    draws: Vec<usize>,
}

impl Resampling {
    /// `resamples` samples of a list of `values`.
    pub(crate) fn new(values: usize, resamples: usize, seed: u64) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let draws = (0..resamples * values).map(|_| random.random_range(0..values)).collect();
        Self { values, draws }
    }

    /// Length of the lists.
    pub(crate) fn values(&self) -> usize {
        self.values
    }

    /// 2.5 % and 97.5 % quantiles of the means of the samples; NaN of nothing.
    ///
    /// # Panics
    ///
    /// If the list does not have the length that the samples were drawn for.
    pub(crate) fn mean_interval(&self, values: &[f64]) -> [f64; 2] {
        assert_eq!(values.len(), self.values, "the samples were drawn for another length");
        if values.is_empty() {
            return [f64::NAN; 2];
        }
        let sum = |draws: &[usize]| draws.iter().map(|&place| values[place]).sum::<f64>();
        let means = self.draws.chunks(self.values).map(|draws| sum(draws) / self.values as f64);
        let means: Vec<f64> = means.collect();
        [quantile(&means, 0.025), quantile(&means, 0.975)]
    }
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
        assert_eq!(bootstrap_mean_interval(&[0.0, 1.0], 10_000, 1), [0.0, 1.0]);
        assert_eq!(bootstrap_mean_interval(&[3.0], 10_000, 1), [3.0, 3.0]);
    }

    #[test]
    fn bootstrap_interval_of_many_values_nears_the_normal_one() {
        let values: Vec<f64> = (0..400).map(|k| (k % 2) as f64).collect();
        // Standard error is 0.5 / sqrt(400) = 0.025.
        let [low, high] = bootstrap_mean_interval(&values, 10_000, 3);
        assert!((low - (0.5 - 0.049)).abs() < 0.003, "{low}");
        assert!((high - (0.5 + 0.049)).abs() < 0.003, "{high}");
        assert_eq!([low, high], bootstrap_mean_interval(&values, 10_000, 3));
    }
}
