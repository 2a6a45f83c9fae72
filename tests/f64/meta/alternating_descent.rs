//! Scene and softness that move together.

use burn::{
    backend::NdArray,
    tensor::{Tensor, backend::Backend},
};
use softrast_meta::{AlternatingDescent, InnerLoop, Objective, Sgd};
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

/// `(θ - φ)² + φ²`.
struct Chase;

impl<B: Backend> Objective<B> for Chase {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>) -> Tensor<B, 1> {
        let off = theta - phi.clone();
        (off.clone() * off).sum() + (phi.clone() * phi).sum()
    }
}

#[test]
fn both_take_a_step_from_the_same_place_at_their_own_rates() {
    let inner = InnerLoop { optimizer: Sgd { learning_rate: 0.1 }, steps: 1 };
    let joint = AlternatingDescent { inner, softness: Sgd { learning_rate: 0.01 } };
    let (theta, phi) = joint.solve::<B, _>(&Chase, vector(&[3.0]), vector(&[1.0]));
    // Slopes: 2 (3 - 1) = 4 by θ, -4 + 2 by φ.
    assert_eq!(numbers(theta), [3.0 - 0.1 * 4.0]);
    assert_eq!(numbers(phi), [1.0 + 0.01 * 2.0]);
}

#[test]
fn softness_at_rest_leaves_the_plain_inner_loop() {
    let inner = InnerLoop { optimizer: Sgd { learning_rate: 0.1 }, steps: 5 };
    let joint = AlternatingDescent { inner, softness: Sgd { learning_rate: 0.0 } };
    let (theta, phi) = joint.solve::<B, _>(&Chase, vector(&[3.0]), vector(&[1.0]));
    let plain = inner.solve::<B, _>(&Chase, vector(&[3.0]), &vector(&[1.0]));
    assert_eq!(numbers(theta), numbers(plain));
    assert_eq!(numbers(phi), [1.0]);
}
