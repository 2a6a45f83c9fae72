//! The network of the depth softness.

use softrast_softness::{DepthSoftness, OPAQUE, initial_mlp};
use softrast_tensor::{Autodiff, NdArray};
use softrast_tests::{numbers, vector};

type B = Autodiff<NdArray<f64>>;

#[test]
fn positive_weights_make_a_straight_line_through_zero() {
    let z = vector::<B>(&[-2.0, 0.0, 0.25, 0.5, 1.0]).require_grad();
    let log = DepthSoftness::Mlp.log_weight(vector(&initial_mlp(3, 0.1)), z.clone());
    let f = numbers(log.clone().exp());
    assert!(f[..2].iter().all(|f| (f / OPAQUE - 1.0).abs() < 1e-14), "{f:?}");
    assert!((f[2] / f[4] - 0.25).abs() < 1e-15 && (f[3] / f[4] - 0.5).abs() < 1e-15);

    // The slope of ln(f(1) z) is 1 / z.
    let slope = numbers(z.grad(&log.sum().backward()).unwrap());
    for (found, expected) in slope.iter().zip([0.0, 0.0, 4.0, 2.0, 1.0]) {
        assert!((found - expected).abs() < 1e-14, "{slope:?}");
    }
}

/// Eq. 3, in scalars.
fn network(weights: &[f64], z: f64) -> f64 {
    let relu = |x: f64| x.max(0.0);
    let product = |from: usize, h: [f64; 4]| -> [f64; 4] {
        std::array::from_fn(|row| (0..4).map(|k| weights[from + 4 * row + k] * h[k]).sum())
    };
    let h1: [f64; 4] = std::array::from_fn(|k| relu(weights[k] * z));
    let h3 = product(20, product(4, h1).map(relu)).map(relu);
    let h4 = product(36, h3);
    (0..4).map(|k| weights[52 + k] * relu(h1[k] + h4[k])).sum()
}

#[test]
fn the_network_is_its_formula_one_number_at_a_time() {
    let weights: Vec<f64> = initial_mlp(5, 0.1).iter().map(|w| (7.0 * w).sin()).collect();
    let z = [-1.0, -0.3, 0.2, 0.9];
    let found = numbers(DepthSoftness::Mlp.log_weight(vector::<B>(&weights), vector(&z)));
    for (found, z) in found.into_iter().zip(z) {
        let expected = network(&weights, z).max(OPAQUE).ln();
        assert!((found - expected).abs() < 1e-13, "at {z}: {found}, not {expected}");
    }
}
