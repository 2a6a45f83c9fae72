//! Comparison of derivatives with central differences, for any loss.

use softrast_meta::{Adam, InnerLoop, Objective};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;

/// Step of the differences, in θ and in φ.
const H: f64 = 1e-5;

/// `|found - exact| / |exact|`.
pub(crate) fn relative_error(found: &[f64], exact: &[f64]) -> f64 {
    let norm = |values: Vec<f64>| values.iter().map(|x| x * x).sum::<f64>().sqrt();
    norm(found.iter().zip(exact).map(|(a, b)| a - b).collect()) / norm(exact.to_vec())
}

fn loss(objective: &impl Objective<B>, theta: &[f64], phi: &[f64]) -> f64 {
    objective.loss(vector(theta), vector(phi), 0).into_scalar()
}

/// Asserts that every entry of the gradient with respect to `theta` is correct to 1e-6 of the largest.
pub(crate) fn check_gradient(
    objective: &(impl Objective<A> + Objective<B>),
    theta: &[f64],
    phi: &[f64],
) {
    check_gradient_to(1e-6, objective, theta, phi);
}

/// [`check_gradient`] with another relative tolerance.
pub(crate) fn check_gradient_to(
    tolerance: f64,
    objective: &(impl Objective<A> + Objective<B>),
    theta: &[f64],
    phi: &[f64],
) {
    let leaf = vector::<A>(theta).require_grad();
    let grads = objective.loss(leaf.clone(), vector(phi), 0).backward();
    let grad = numbers(leaf.grad(&grads).unwrap());
    let largest = grad.iter().fold(0.0, |largest: f64, g| largest.max(g.abs()));
    for (k, grad) in grad.into_iter().enumerate() {
        let at = |h: f64| {
            let mut moved = theta.to_vec();
            moved[k] += h;
            loss(objective, &moved, phi)
        };
        let slope = (at(H) - at(-H)) / (2.0 * H);
        let off = (slope - grad).abs() / largest;
        assert!(off < tolerance, "entry {k}: {slope} and {grad}, off by {off:.1e}");
    }
}

/// Asserts that the meta-gradient through two steps of Adam from `theta` is correct to 1e-5, for a softness of one parameter.
pub(crate) fn check_meta_gradient(
    objective: &(impl Objective<B> + Objective<A> + Objective<Autodiff<A>>),
    learning_rate: f64,
    theta: &[f64],
    phi: f64,
) {
    let inner = InnerLoop { optimizer: Adam::new(learning_rate), steps: 2 };
    let leaf = vector::<A>(&[phi]).require_grad();
    let end: Tensor<A, 1> = inner.solve(objective, vector(theta), &leaf);
    let grads = objective.loss(end, leaf.clone(), 0).backward();
    let grad = numbers(leaf.grad(&grads).unwrap())[0];
    let at = |h: f64| {
        let end = inner.solve::<B, _>(objective, vector(theta), &vector(&[phi + h]));
        loss(objective, &numbers(end), &[phi + h])
    };
    let slope = (at(H) - at(-H)) / (2.0 * H);
    assert!((slope / grad - 1.0).abs() < 1e-5, "{slope} and {grad}");
}
