//! Scales that move over the steps.

use burn::backend::NdArray;
use softrast_softness::{EdgeSoftness, Family, ScalePath, Softness};
use softrast_tests::vector;

type B = NdArray<f64>;

#[test]
fn a_path_joins_its_knots_above_the_floor() {
    let knots = vector::<B>(&[0.0, 2.0, 1.0]);
    for (part, expected) in [(0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (0.75, 1.5), (1.0, 1.0)] {
        let scale: f64 = ScalePath::scale(&knots, 0.5, part).into_scalar();
        assert!((scale - 0.5 - f64::exp(expected)).abs() < 1e-12, "{part}: {scale}");
    }
    let alone: f64 = ScalePath::scale(&vector::<B>(&[1.0]), 0.0, 0.7).into_scalar();
    assert!((alone - f64::exp(1.0)).abs() < 1e-12);
}

#[test]
fn a_widened_softness_is_seen_at_the_distance_in_scales() {
    let x = vector::<B>(&[-0.3, -0.02, 0.1]);
    for family in Family::ALL {
        for squared in [false, true] {
            let softness = EdgeSoftness { family, squared };
            let phi = vector(&softness.default_phi(1.0));
            let widened = softness.widened(phi.clone(), vector(&[0.09]));
            let found = softness.value(widened, x.clone());
            let divisor: f64 = if squared { 0.3 } else { 0.09 };
            let expected = softness.value(phi, x.clone() * divisor.recip());
            let off: f64 = (found - expected).abs().max().into_scalar();
            assert!(off < 1e-12, "{softness:?}: {off}");
        }
    }
}
