//! Joint descent of scene and softness.

use softrast_meta::{BilevelProblem, InnerLoop, MetaGradient, Objective, OuterSteps, Sgd};
use softrast_tensor::{Backend, NdArray, Tensor};
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

/// `(θ - φ)² + φ²`.
struct Chase;

impl<B: Backend> Objective<B> for Chase {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let off = theta - phi.clone();
        (off.clone() * off).sum() + (phi.clone() * phi).sum()
    }
}

/// The final loss from θ = 3 and φ = 1, and the distance moved by φ.
fn moved(steps: usize, learning_rate: f64) -> (f64, f64) {
    let problem = BilevelProblem {
        objective: Chase,
        outer_loss: Chase,
        inner: InnerLoop { optimizer: Sgd { learning_rate: 0.1 }, steps },
        start: vector::<B>(&[3.0]),
        outer_steps: OuterSteps::Last,
    };
    let along = MetaGradient::AlternatingDescent { learning_rate };
    let found = along.estimate(&problem, &vector(&[1.0]), 0);
    (found.loss, -numbers(found.gradient)[0])
}

#[test]
fn both_take_a_step_from_the_same_place_at_their_own_rates() {
    // Slopes: 2 (3 - 1) = 4 with respect to θ, -4 + 2 with respect to φ, which Adam turns into a step of its rate.
    let (loss, way) = moved(1, 0.01);
    assert!((way - 0.01).abs() < 1e-10, "{way}");
    let (theta, phi) = (3.0 - 0.1 * 4.0, 1.0 + way);
    assert!((loss - ((theta - phi).powi(2) + phi * phi)).abs() < 1e-12, "{loss}");
}

#[test]
fn softness_at_rest_leaves_the_plain_inner_loop() {
    let (loss, way) = moved(5, 0.0);
    // Each step multiplies the distance to φ by 0.8.
    assert_eq!(way, 0.0);
    assert!((loss - ((2.0 * 0.8_f64.powi(5)).powi(2) + 1.0)).abs() < 1e-12, "{loss}");
}
