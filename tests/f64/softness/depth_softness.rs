//! Depth softness.

use softrast_softness::{DepthSoftness, Family, OPAQUE, initial_mlp};
use softrast_tensor::NdArray;
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

fn log_weights(softness: DepthSoftness, phi: Vec<f64>) -> Vec<f64> {
    let nearness: Vec<f64> = (1..10).map(|k| 0.1 * f64::from(k)).collect();
    numbers(softness.log_weight(vector::<B>(&phi), vector(&nearness)))
}

#[test]
fn every_default_favours_the_nearer_face() {
    let families = Family::ALL.map(DepthSoftness::Family);
    for softness in families.into_iter().chain([DepthSoftness::Mlp]) {
        // Forward laws are 0 before their edge, and bounded ones beyond their reach.
        let dull = [Family::ExpForward, Family::GammaForward, Family::LevyForward];
        if dull.map(DepthSoftness::Family).contains(&softness) {
            continue;
        }
        let weights = log_weights(softness, softness.default_phi(2.0));
        assert!(weights.windows(2).all(|w| w[0] < w[1]), "{softness}: {weights:?}");
    }
}

#[test]
fn exp_is_a_softmax_of_the_nearness() {
    let softness = DepthSoftness::Family(Family::Exp);
    let weights = log_weights(softness, softness.default_phi(0.05));
    assert!(weights.windows(2).all(|w| (w[1] - w[0] - 2.0).abs() < 1e-12), "{weights:?}");
}

#[test]
fn a_network_that_is_off_gives_the_least_weight_everywhere() {
    let phi = initial_mlp(0, 1.0).into_iter().map(|w| -w).collect();
    assert!(log_weights(DepthSoftness::Mlp, phi).iter().all(|w| *w == OPAQUE.ln()));
}
