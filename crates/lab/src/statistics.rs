use statrs::distribution::{ContinuousCDF, StudentsT};

/// Arithmetic mean; NaN for no values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Median: the middle value, or the mean of the middle two. NaN for no values.
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Value below which the fraction `q` of the values lies, interpolated linearly between them.
///
/// With the `n` values sorted, that is position `q (n - 1)`; NaN for no values. The order of the
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

/// 95 % interval of a mean, as in all results: `[low, high]`. One value gives an interval of width zero; none gives NaN.
pub fn mean_interval(values: &[f64]) -> [f64; 2] {
    mean_interval_at(0.95, values)
}

/// Interval that contains the mean with this probability: `[low, high]`.
///
/// Student's interval: the standard error of the mean times a quantile of the t distribution, which
/// is valid for few values too. Source: Student 1908.
pub(crate) fn mean_interval_at(level: f64, values: &[f64]) -> [f64; 2] {
    let middle = mean(values);
    let freedom = values.len().saturating_sub(1) as f64;
    let Ok(student) = StudentsT::new(0.0, 1.0, freedom) else { return [middle; 2] };
    let variance = values.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / freedom;
    let error = (variance / values.len() as f64).sqrt();
    let half = error * student.inverse_cdf(0.5 + 0.5 * level);
    [middle - half, middle + half]
}

/// 95 % interval of a rate, given `successes` out of `trials`: `[low, high]`.
///
/// Source: Wilson 1927, the score interval, with z = 1.96: it stays in [0, 1] and is useful for few
/// trials and for rates near 0 or 1. No trials give [0, 1].
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
    fn student_interval_matches_hand_worked_values() {
        // Mean 2.5, variance 5 / 3, error sqrt(5 / 12); t for 3 degrees of freedom is 3.182446.
        let [low, high] = mean_interval(&[1.0, 2.0, 3.0, 4.0]);
        let half = 3.182_446_305 * (5.0_f64 / 12.0).sqrt();
        assert!((low - (2.5 - half)).abs() < 1e-7 && (high - (2.5 + half)).abs() < 1e-7);
        // 99 %: t is 5.840909.
        let [low, _] = mean_interval_at(0.99, &[1.0, 2.0, 3.0, 4.0]);
        assert!((low - (2.5 - 5.840_909_31 * (5.0_f64 / 12.0).sqrt())).abs() < 1e-6);
        assert_eq!((mean_interval(&[3.0]), mean_interval(&[2.0; 5])), ([3.0; 2], [2.0; 2]));
        assert!(mean_interval(&[])[0].is_nan() && mean_interval(&[f64::NAN, 1.0])[1].is_nan());
    }

    #[test]
    fn student_interval_of_many_values_nears_the_normal_one() {
        let values: Vec<f64> = (0..400).map(|k| (k % 2) as f64).collect();
        // Standard error is 0.5 / sqrt(400) = 0.025.
        let [low, _] = mean_interval(&values);
        assert!((low - (0.5 - 0.049)).abs() < 0.001, "{low}");
    }
}
