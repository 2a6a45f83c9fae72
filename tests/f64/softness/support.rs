//! Supports against closed forms.

use softrast_softness::{Family, Softness, Support, families::Mlp, support};

use super::{B, assert_relative, numbers, vector};

fn support_of(family: Family, scale: f64, excess: f64) -> Support {
    support::<B>(&family, &family.default_phi(scale), excess, &Default::default())
}

#[test]
fn the_support_of_a_logistic_is_the_closed_form() {
    // ln(1 + exp(-r / scale)) = e outside; 1 / (1 + exp(r / scale)) = e inside.
    let found = support_of(Family::Logistic, 0.01, 1e-6);
    assert_relative(found.outer, -0.01 * 1e-6_f64.exp_m1().ln(), 1e-9, "outer");
    assert_relative(found.inner, 0.01 * (1e6_f64 - 1.0).ln(), 1e-9, "inner");
    assert_eq!(found.left, 0.0);
    assert_relative(found.right, 1e6_f64.ln(), 1e-9, "right");
}

#[test]
fn kinks_are_found_to_nine_digits() {
    let found = support_of(Family::Uniform, 0.01, 1e-12);
    assert_relative(found.outer, 0.01, 1e-9, "uniform, outer");
    assert_relative(found.inner, 0.01, 1e-9, "uniform, inner");

    let found = support_of(Family::ExpForward, 0.01, 1e-6);
    assert_eq!(found.outer, 0.0);
    assert_relative(found.inner, 0.01 * 1e6_f64.ln(), 1e-9, "exp, inner");

    let shifted =
        support::<B>(&Family::ExpForward, &[0.01_f64.ln(), 2.0], 1e-12, &Default::default());
    assert_relative(shifted.outer, 0.02, 1e-9, "shifted exp, outer");
}

#[test]
fn heavy_tails_reach_far_or_for_ever() {
    let found = support_of(Family::Cauchy, 0.01, 1e-3);
    assert_relative(found.outer, 0.01 / (std::f64::consts::PI * 1e-3), 1e-3, "outer");
    let found = support_of(Family::Cauchy, 0.01, 1e-12);
    assert_eq!((found.outer, found.inner), (f64::INFINITY, f64::INFINITY));
}

#[test]
fn a_tail_that_is_not_zero_is_the_left_limit() {
    let found = support_of(Family::Mlp, 0.01, 1e-9);
    assert_relative(found.left, (-15.0_f64).exp().ln_1p(), 1e-9, "left");
    assert!(found.outer > 0.01 && found.outer < 100.0);
    let phi = Family::Mlp.default_phi(0.01);
    let beyond = vector(&[1.001, 1.5, 4.0, 1e3].map(|k| -k * found.outer));
    let depths = numbers(Mlp.optical_depth(vector(&phi), beyond));
    assert!(depths.iter().all(|q| (q - found.left).abs() <= 1e-9));
}
