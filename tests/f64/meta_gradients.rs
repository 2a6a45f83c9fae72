//! Meta-gradients through a whole inner loop, on `Autodiff<Autodiff<B>>`, in f64, compared with central differences, and the fused op
//! compared with the reference.
//!
//! The fused op keeps the support and knots chosen at φ while φ varies.

use softrast_inverse::{Method, ScheduledSoftness};
use softrast_meta::{Adam, InnerLoop, Objective, Optimizer, Sgd};
use softrast_raster::low_level::Rasterizer;
use softrast_softness::{
    EdgeSoftness, Family, Softness,
    families::{Logistic, Mlp},
};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::{Shape2d, numbers, shape2d_start, vector};

use crate::differences::relative_error;

type B = NdArray<f64>;
type A = Autodiff<B>;

/// Width of the softness in NDC: a little over half a pixel.
const SCALE: f64 = 0.1;
/// Tolerance of the fused op: far below the compared differences.
const FINE: f64 = 1e-9;
/// Tolerance where the op is compared with differences of itself, whose table can be shorter.
const COARSE: f64 = 1e-6;
/// Half the distance of a central difference, relative to the size of the parameter. One of them has to meet the bound: larger ones cross
/// kinks of the image and of the table, smaller ones are dominated by rounding (docs/notes.md, Meta-gradients: checks).
const SHARES: [f64; 4] = [1e-5, 1e-6, 1e-7, 1e-4];

const SGD: InnerLoop<Sgd> = InnerLoop { optimizer: Sgd { learning_rate: 0.3 }, steps: 5 };
/// Bound relative to central differences.
const SGD_BOUND: f64 = 1e-5;

/// Ten steps.
fn adam() -> InnerLoop<Adam> {
    InnerLoop { optimizer: Adam::new(0.01), steps: 10 }
}
const ADAM_BOUND: f64 = 1e-4;

fn logistic() -> Vec<f64> {
    Family::Logistic.default_phi(SCALE)
}

fn mlp() -> Vec<f64> {
    Family::Mlp.default_phi(SCALE)
}

fn by_fused_op<S: Softness>(softness: S, phi: &[f64], tolerance: f64) -> Shape2d<S> {
    Shape2d::by_fused_op(softness, &vector::<B>(phi), tolerance)
}

/// Loss of `problem` after `inner`, `[1]`.
fn outer_loss<B: Backend>(
    problem: &(impl Objective<B> + Objective<Autodiff<B>>),
    inner: &InnerLoop<impl Optimizer>,
    phi: Tensor<B, 1>,
) -> Tensor<B, 1> {
    let theta = inner.solve(problem, vector(&shape2d_start()), &phi);
    problem.loss(theta, phi, inner.steps)
}

fn meta_gradient(
    problem: &Shape2d<impl Softness>,
    inner: &InnerLoop<impl Optimizer>,
    phi: &[f64],
) -> Vec<f64> {
    let phi = vector::<A>(phi).require_grad();
    let grads = outer_loss(problem, inner, phi.clone()).backward();
    numbers(phi.grad(&grads).expect("the result depends on phi"))
}

/// The meta-gradient by central differences whose half distance is `share` of each parameter.
fn central_difference(
    problem: &Shape2d<impl Softness>,
    inner: &InnerLoop<impl Optimizer>,
    phi: &[f64],
    share: f64,
) -> Vec<f64> {
    let slope = |k: usize| {
        let h = share * phi[k].abs();
        let [low, high] = [-h, h].map(|step| {
            let mut phi = phi.to_vec();
            phi[k] += step;
            outer_loss::<B>(problem, inner, vector(&phi)).into_scalar()
        });
        (high - low) / (2.0 * h)
    };
    (0..phi.len()).map(slope).collect()
}

/// Asserts that the meta-gradient agrees with central differences to a relative `bound`.
fn check(
    problem: &Shape2d<impl Softness>,
    inner: &InnerLoop<impl Optimizer>,
    phi: &[f64],
    bound: f64,
) {
    let tracked = meta_gradient(problem, inner, phi);
    let agrees = SHARES.iter().any(|&share| {
        let error = relative_error(&central_difference(problem, inner, phi, share), &tracked);
        println!("{} parameters, h = {share:e}: relative error {error:.1e}", phi.len());
        error <= bound
    });
    assert!(agrees, "no central difference agrees with the meta-gradient to {bound:e}");
}

#[test]
fn reference_with_logistic_through_gradient_descent() {
    check(&Shape2d::by_reference(Logistic), &SGD, &logistic(), SGD_BOUND);
}

#[test]
fn reference_with_logistic_through_adam() {
    check(&Shape2d::by_reference(Logistic), &adam(), &logistic(), ADAM_BOUND);
}

#[test]
fn reference_with_mlp_through_gradient_descent() {
    check(&Shape2d::by_reference(Mlp), &SGD, &mlp(), SGD_BOUND);
}

#[test]
fn reference_with_mlp_through_adam() {
    check(&Shape2d::by_reference(Mlp), &adam(), &mlp(), ADAM_BOUND);
}

#[test]
fn fused_op_with_logistic_through_gradient_descent() {
    check(&by_fused_op(Logistic, &logistic(), FINE), &SGD, &logistic(), SGD_BOUND);
}

#[test]
fn fused_op_with_logistic_through_adam() {
    check(&by_fused_op(Logistic, &logistic(), FINE), &adam(), &logistic(), ADAM_BOUND);
}

#[test]
fn fused_op_with_mlp_through_gradient_descent() {
    check(&by_fused_op(Mlp, &mlp(), COARSE), &SGD, &mlp(), SGD_BOUND);
}

#[test]
fn fused_op_with_mlp_through_adam() {
    check(&by_fused_op(Mlp, &mlp(), COARSE), &adam(), &mlp(), ADAM_BOUND);
}

/// Relative error of the fused meta-gradient against the reference, through both optimisers.
fn fused_errors<S: Softness>(softness: S, phi: &[f64], tolerance: f64) -> [f64; 2] {
    let reference = Shape2d::by_reference(softness.clone());
    let fused = by_fused_op(softness, phi, tolerance);
    let errors = [
        relative_error(&meta_gradient(&fused, &SGD, phi), &meta_gradient(&reference, &SGD, phi)),
        relative_error(
            &meta_gradient(&fused, &adam(), phi),
            &meta_gradient(&reference, &adam(), phi),
        ),
    ];
    println!("{} parameters, tolerance {tolerance:e}: errors {errors:?}", phi.len());
    errors
}

// The largest error of a table of cubics is that of its second derivative.
#[test]
fn both_ways_to_draw_have_the_same_meta_gradient() {
    let edge = EdgeSoftness::new(Family::Logistic);
    let moving = Method::new("logistic", ScheduledSoftness::decay(edge, SCALE, SCALE / 2.0));
    let learning = moving.learning_tolerance();
    assert_eq!(learning, 1e-3);
    for (tolerance, bound) in [(FINE, 1e-4), (Rasterizer::TOLERANCE, 1e-2), (learning, 0.1)] {
        let logistic = fused_errors(Logistic, &logistic(), tolerance);
        let mlp = fused_errors(Mlp, &mlp(), tolerance);
        assert!(
            logistic.into_iter().chain(mlp).all(|error| error <= bound),
            "{logistic:?} {mlp:?}"
        );
    }
}
