//! Families: their values, derivatives and supports.

mod depth_network;
mod depth_softness;
mod families;
mod gamma;
mod hand_worked;
mod mirror;
mod mlp;
mod provided;
mod scale;
mod soft_step;
mod support;
mod tails;

use softrast_tensor::{Backend, NdArray, Tensor};

type B = NdArray<f64>;

/// Relative error allowed against references: the exponent of a tail, up to 450, multiplies the
/// rounding of an f64.
const RELATIVE: f64 = 2e-13;

fn vector(values: &[f64]) -> Tensor<B, 1> {
    softrast_tests::vector(values)
}

/// The numbers of a tensor that must hold f64.
fn numbers<B: Backend>(tensor: Tensor<B, 1>) -> Vec<f64> {
    tensor.into_data().to_vec().expect("the tensor holds f64")
}

#[track_caller]
fn assert_relative(found: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (found - expected).abs();
    assert!(error <= tolerance * expected.abs(), "{what}: {found:e}, expected {expected:e}");
}
