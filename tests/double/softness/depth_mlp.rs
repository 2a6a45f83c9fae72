//! The network that sees depths.

use burn::backend::{Autodiff, NdArray};
use softrast_softness::{DepthMlp, initial_mlp};
use softrast_tests::vector;

type B = Autodiff<NdArray<f64>>;

#[test]
fn positive_weights_make_a_straight_line_through_zero() {
    let phi = vector::<B>(&initial_mlp(3, 0.1));
    let z = [-2.0, 0.0, 0.25, 0.5, 1.0];
    let f: Vec<f64> = DepthMlp.value(phi.clone(), vector(&z)).into_data().to_vec().unwrap();
    assert_eq!(f[..2], [0.0, 0.0]);
    assert!((f[2] / f[4] - 0.25).abs() < 1e-15 && (f[3] / f[4] - 0.5).abs() < 1e-15);

    let slope = DepthMlp.derivative(phi, vector(&z));
    let slope: Vec<f64> = slope.into_data().to_vec().unwrap();
    assert_eq!(slope[..2], [0.0, 0.0]);
    assert!(slope[2..].iter().all(|slope| (slope / f[4] - 1.0).abs() < 1e-15));
}

#[test]
fn the_derivative_agrees_with_the_automatic_one() {
    let weights: Vec<f64> = initial_mlp(5, 0.1).iter().map(|w| (7.0 * w).sin()).collect();
    let z = vector::<B>(&[-1.0, -0.3, 0.2, 0.9]).require_grad();
    let grads = DepthMlp.value(vector(&weights), z.clone()).sum().backward();
    let found = DepthMlp.derivative(vector(&weights), z.clone()).into_data();
    let expected = z.grad(&grads).unwrap().into_data();
    let tolerance = burn::tensor::Tolerance::<f64>::absolute(1e-14);
    found.assert_approx_eq(&expected, tolerance);
}
