//! A softness as a module of burn.

use softrast_softness::{EdgeSoftness, Family, SoftStep, Softness};
use softrast_tensor::{
    Autodiff, DType, NdArray, Tensor,
    burn::module::{AutodiffModule, Module},
};

type B = Autodiff<NdArray<f64>>;

fn step() -> SoftStep<B> {
    let softness = EdgeSoftness::new(Family::Logistic);
    SoftStep::new(softness, &softness.default_phi(0.5), DType::F64, &Default::default())
}

#[test]
fn a_step_passes_gradients_to_its_parameters() {
    let step = step();
    let x = Tensor::from_data([[0.5_f64]], (&Default::default(), DType::F64));
    let grads = step.forward::<2>(x).sum().backward();
    let found: f64 = step.phi.grad(&grads).unwrap().into_scalar();
    // ds / d ln(scale) = -u s (1 - s) at u = 1.
    let s = 1.0 / (1.0 + (-1.0_f64).exp());
    assert!((found + s * (1.0 - s)).abs() < 1e-15);
}

#[test]
fn a_record_restores_the_parameters_and_leaves_the_family() {
    let trained = step();
    let mut other = step();
    other.phi = other.phi.map(|phi| phi + 1.0);
    other.softness.family = Family::Gauss;
    let other = other.load_record(trained.clone().into_record());
    assert_eq!(other.phi.val().into_data(), trained.phi.val().into_data());
    assert_eq!(other.softness.family, Family::Gauss);
    assert_eq!(trained.valid().softness, trained.softness);
}
