//! The network of the paper compared with its formula, for several weights.

use softrast_softness::{Softness, families::Mlp, initial_mlp};

use super::{assert_relative, numbers, vector};

/// Eq. 2, in scalars.
fn mlp_logit(weights: &[f64], x: f64) -> f64 {
    let product = |from: usize, h: [f64; 4]| -> [f64; 4] {
        std::array::from_fn(|row| (0..4).map(|k| weights[from + 4 * row + k] * h[k]).sum())
    };
    let h1: [f64; 4] = std::array::from_fn(|k| (weights[k] * x).tanh());
    let h2 = product(4, h1).map(f64::tanh);
    let h3 = product(20, h2).map(f64::tanh);
    let h4 = product(36, h3);
    (0..4).map(|k| weights[52 + k] * (h4[k] + h1[k]).tanh()).sum()
}

#[test]
fn mlp_matches_its_formula_one_number_at_a_time() {
    for weights in [initial_mlp(1, 0.05), POSE_SPOT_FINAL.to_vec()] {
        for x in [-0.7, -0.02, -1e-3, -1e-5, 1e-6, 0.003, 0.4] {
            let expected = 1.0 / (1.0 + (-mlp_logit(&weights, x)).exp());
            let found = numbers(Mlp.value(vector(&weights), vector(&[x])))[0];
            assert_relative(found, expected, 1e-12, "mlp");
        }
    }
}

#[test]
fn mlp_is_one_half_at_zero_and_odd_around_it() {
    for weights in [initial_mlp(2, 0.05), POSE_SPOT_FINAL.to_vec()] {
        assert_eq!(numbers(Mlp.value(vector(&weights), vector(&[0.0]))), [0.5]);
        let x = [1e-6, 1e-3, 0.05, 0.8];
        let above = numbers(Mlp.optical_depth(vector(&weights), vector(&x)));
        let below = numbers(Mlp.value(vector(&weights), vector(&x.map(|x| -x))));
        for (above, below) in above.into_iter().zip(below) {
            assert_relative((-above).exp(), below, 1e-13, "1 - s(x) against s(-x)");
        }
    }
}

#[test]
fn the_released_weights_are_a_step_when_read_as_eq_2() {
    let phi = vector(&POSE_SPOT_FINAL);
    let s = numbers(Mlp.value(phi, vector(&[-1e-5, 1e-6])));
    assert_relative(s[0], 2.321_918e-7, 1e-5, "0.01 px outside");
    assert_relative(s[1], 0.844_130, 1e-5, "0.001 px inside");
}

#[test]
fn an_untrained_mlp_has_the_slope_and_the_reach_that_were_asked_for() {
    for (seed, scale) in [(0, 1e-4), (1, 0.02), (2, 3.0)] {
        let weights = initial_mlp(seed, scale);
        let slope = numbers(Mlp.density(vector(&weights), vector(&[0.0])))[0];
        assert_relative(slope, 0.25 / scale, 1e-12, "slope");
        let depth = numbers(Mlp.optical_depth(vector(&weights), vector(&[1e9])))[0];
        assert_relative(depth, 15.0, 1e-6, "reach");
        assert!(weights[52..].iter().sum::<f64>() >= 15.0);
        assert!(weights.iter().all(|w| *w > 0.0) && weights[4] != weights[5]);
    }
}

/// The pose weights released with the paper (Wu et al. 2024), after 300 steps on `spot`.
#[rustfmt::skip]
const POSE_SPOT_FINAL: [f64; 56] = [
    9.63814449, 10.0883245, 9.74916553, 9.69078255, 10.5310078, 10.5522385, 10.3488836,
    10.8534765, 8.67665577, 9.30463982, 9.31416893, 8.5548439, 8.86273861, 8.87642384,
    9.04422188, 9.08981705, 9.09902096, 8.79595661, 8.64486885, 9.13122463, 11.2160158,
    0.20364666, 0.374835074, 0.256443322, 9.98334789, 0.0901891589, 0.393642426, 0.606878221,
    9.92040634, 0.47434032, 0.857925415, 0.448599875, 10.266386, 0.456865549, 0.601190686,
    0.817919731, 10.4768639, 0.81752795, 0.974706769, 0.463839173, 9.79014492, 0.262961388,
    0.840452611, 0.496758759, 9.90575504, 0.116844118, 0.0320739746, 0.0779958963, 10.0728893,
    0.774203002, 0.770320535, 0.017784059, 8.86112309, 6.68454504, 7.20347214, 7.11206675,
];
