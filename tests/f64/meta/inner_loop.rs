//! Two steps of an inner loop whose meta-gradients are known, and invariants of every loop.

use softrast_meta::{Adam, InnerLoop, Objective, Optimizer, Sgd};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::vector;

type B = NdArray<f64>;
type A = Autodiff<B>;

const START: f64 = 1.5;
const CENTRE: f64 = 0.2;
const PHI: f64 = -0.3;

/// `0.5 exp(φ) (θ0 - 0.2)²`: depends on the first parameter only.
struct Parabola;

impl<B: Backend> Objective<B> for Parabola {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let mut pull = vec![0.0; theta.dims()[0]];
        pull[0] = 0.5;
        let off = theta - CENTRE;
        (off.clone() * off * vector(&pull)).sum() * phi.exp()
    }
}

/// Meta-gradient of the final loss, through the steps and without them.
fn meta_gradients(optimizer: impl Optimizer, steps: usize, start: &[f64]) -> [f64; 2] {
    let end = |phi: &Tensor<A, 1>| {
        InnerLoop { optimizer, steps }.solve(&Parabola, vector::<A>(start), phi)
    };
    let phi = vector::<A>(&[PHI]).require_grad();
    let theta = end(&phi);
    [theta.clone(), theta.detach()].map(|theta| {
        let grads = Parabola.loss(theta, phi.clone(), steps).backward();
        phi.grad(&grads).unwrap().into_scalar()
    })
}

/// Total and direct derivative of the loss with respect to φ at a solution that moves by `rate` with φ.
fn expected(end: f64, rate: f64) -> [f64; 2] {
    let (k, off) = (PHI.exp(), end - CENTRE);
    let direct = 0.5 * k * off * off;
    [direct + k * off * rate, direct]
}

fn assert_close(found: [f64; 2], expected: [f64; 2]) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
    }
}

#[test]
fn two_steps_of_gradient_descent_have_the_known_meta_gradient() {
    let learning_rate = 0.4;
    // A step multiplies θ - c by 1 - a k, and dk/dφ = k.
    let (shrink, a) = (1.0 - learning_rate * PHI.exp(), START - CENTRE);
    let rate = -2.0 * a * shrink * learning_rate * PHI.exp();
    let found = meta_gradients(Sgd { learning_rate }, 2, &[START]);
    assert_close(found, expected(CENTRE + a * shrink * shrink, rate));
}

#[test]
fn two_steps_of_adam_have_the_known_meta_gradient() {
    let adam = Adam { epsilon_root: 1e-3, epsilon: 1e-2, ..Adam::new(0.4) };
    let Adam { learning_rate, beta1, beta2, epsilon, epsilon_root } = adam;
    let k = PHI.exp();
    // h / (sqrt(w + e) + E), and its derivative with respect to h and w.
    let ratio = |(h, dh): (f64, f64), (w, dw): (f64, f64)| {
        let root = (w + epsilon_root).sqrt();
        let below = root + epsilon;
        (h / below, dh / below - h * dw / (2.0 * root * below * below))
    };
    let g1 = k * (START - CENTRE);
    let (move1, rate1) = ratio((g1, g1), (g1 * g1, 2.0 * g1 * g1));
    let (theta1, dtheta1) = (START - learning_rate * move1, -learning_rate * rate1);
    let g2 = k * (theta1 - CENTRE);
    let dg2 = g2 + k * dtheta1;
    // Both means with bias correction: (b (1-b) x1 + (1-b) x2) / (1 - b²) = (b x1 + x2) / (1 + b).
    let mean = |b: f64, x1: f64, x2: f64| (b * x1 + x2) / (1.0 + b);
    let m = (mean(beta1, g1, g2), mean(beta1, g1, dg2));
    let v = (mean(beta2, g1 * g1, g2 * g2), mean(beta2, 2.0 * g1 * g1, 2.0 * g2 * dg2));
    let (move2, rate2) = ratio(m, v);
    let rate = dtheta1 - learning_rate * rate2;
    let found = meta_gradients(adam, 2, &[START]);
    assert_close(found, expected(theta1 - learning_rate * move2, rate));
}

#[test]
fn parameter_without_gradient_leaves_the_meta_gradient_finite() {
    // The second parameter has gradient 0 (docs/notes.md, Meta-gradients: checks).
    let root = |epsilon_root: f64| Adam { epsilon_root, ..Adam::new(0.05) };
    let start = [START, 3.0];
    let without = meta_gradients(root(0.0), 30, &start);
    assert!(without[0].is_nan(), "the reason for epsilon_root: {without:?}");
    for epsilon_root in [1e-20, 1e-16, 1e-12] {
        let with = meta_gradients(root(epsilon_root), 30, &start);
        let alone = meta_gradients(root(epsilon_root), 30, &start[..1]);
        assert!(with[0].is_finite() && with == alone, "{with:?} {alone:?}");
    }
}

#[test]
fn plain_and_tracked_runs_take_the_same_steps() {
    let inner = InnerLoop { optimizer: Adam::new(0.05), steps: 7 };
    let plain = inner.solve::<B, _>(&Parabola, vector(&[START]), &vector(&[PHI]));
    let phi = vector::<A>(&[PHI]).require_grad();
    let tracked = inner.solve(&Parabola, vector::<A>(&[START]), &phi).inner();
    assert_eq!(plain.into_scalar(), tracked.into_scalar());
}
