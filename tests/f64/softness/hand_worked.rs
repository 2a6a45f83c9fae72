//! Every family compared with values computed by hand.

use softrast_softness::{EdgeSoftness, Family, Softness};

use super::{assert_relative, numbers, vector};

/// Family, distance in scales, value computed by hand.
fn hand_worked() -> Vec<(Family, f64, f64)> {
    use std::f64::consts::{E, LN_2};
    vec![
        (Family::Logistic, 3_f64.ln(), 0.75),
        (Family::Gauss, 1.0, 0.841_344_746_068_542_9),
        (Family::Laplace, LN_2, 0.75),
        (Family::Exp, -LN_2, 0.5),
        (Family::ExpForward, LN_2, 0.5),
        (Family::Gamma, -0.25, 0.479_500_122_186_953_5), // erfc(1/2)
        (Family::GammaForward, 0.25, 0.520_499_877_813_046_5), // erf(1/2)
        (Family::Levy, -0.5, 0.842_700_792_949_714_9),   // erf(1)
        (Family::LevyForward, 0.5, 0.157_299_207_050_285_1), // erfc(1)
        (Family::Uniform, 0.5, 0.75),
        (Family::CubicHermite, 0.5, 0.84375),
        (Family::Wigner, 0.5, 2.0 / 3.0 + 0.75_f64.sqrt() / (2.0 * std::f64::consts::PI)),
        (Family::Gudermannian, 3_f64.sqrt().ln(), 2.0 / 3.0),
        (Family::Cauchy, 1.0, 0.75),
        (Family::Reciprocal, 1.0, 0.75),
        (Family::GumbelMax, 0.0, 1.0 / E),
        (Family::GumbelMin, 0.0, 1.0 - 1.0 / E),
    ]
}

#[test]
fn families_take_their_hand_worked_values() {
    for (family, u, expected) in hand_worked() {
        let scale = 0.02;
        let x = vector(&[u * scale]);
        let found = numbers(family.value(vector(&family.default_phi(scale)), x));
        assert_relative(found[0], expected, 1e-14, family.name());

        let squared = EdgeSoftness::squared(family);
        let d = vector(&[(u.abs() * scale).sqrt().copysign(u)]);
        let found = numbers(squared.value(vector(&squared.default_phi(scale)), d));
        assert_relative(found[0], expected, 1e-14, family.name());
    }
}
