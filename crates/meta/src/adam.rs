use serde::Serialize;
use softrast_tensor::{Backend, Tensor};

use crate::Optimizer;

/// Adam with a step that is differentiable everywhere, including where the gradient is zero.
///
/// With `m` and `v` the running means of the gradient and of its square, both corrected for their
/// start at zero, a step is `θ - learning_rate · m / (sqrt(v + epsilon_root) + epsilon)`.
///
/// `epsilon_root` belongs inside the root: without it a parameter whose gradient has always been
/// zero makes the meta-gradient NaN (the slope of the root at 0 is infinite). Larger values are
/// safer but dull small gradients: keep it well below the squared gradients that matter.
///
/// The learning rate may change from step to step: the optimiser is only read.
///
/// Source: Kingma and Ba 2015, Algorithm 1. For `epsilon_root`:
/// docs/notes.md, Meta-gradients: Adam.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Adam {
    /// Largest move of a parameter in one step, roughly.
    pub learning_rate: f64,
    /// Decay of the mean gradient, in [0, 1).
    pub beta1: f64,
    /// Decay of the mean squared gradient, in [0, 1).
    pub beta2: f64,
    /// Added to the root, in the unit of the gradient.
    pub epsilon: f64,
    /// Added under the root, in the squared unit of the gradient.
    pub epsilon_root: f64,
}

/// State of [`Adam`] between steps.
///
/// ```
/// use softrast_meta::{Adam, AdamState, Optimizer};
/// use softrast_tensor::{NdArray, numbers, vector};
///
/// let (adam, theta) = (Adam::new(0.1), vector::<NdArray>(&[1.0, 1.0]));
/// let state: AdamState<NdArray, 1> = adam.init(&theta);
/// let (theta, state) = adam.step(theta, vector(&[5.0, -0.01]), state);
/// // The first step has the length of the learning rate for any gradient.
/// assert!(numbers(theta).iter().zip([0.9, 1.1]).all(|(a, b)| (a - b).abs() < 1e-5));
/// assert_eq!(state.step, 1);
/// ```
#[derive(Clone, Debug)]
pub struct AdamState<B: Backend, const D: usize> {
    /// Running mean of the gradient, not corrected.
    pub m: Tensor<B, D>,
    /// Running mean of the squared gradient, not corrected.
    pub v: Tensor<B, D>,
    /// Steps taken so far.
    pub step: usize,
}

impl Adam {
    /// Adam with betas 0.9 and 0.99, epsilon 1e-8 and `epsilon_root` 1e-16, whose root is epsilon:
    /// it changes a step no more than epsilon does.
    ///
    /// Source: Wu et al. 2024 for the betas.
    pub fn new(learning_rate: f64) -> Self {
        Self { learning_rate, beta1: 0.9, beta2: 0.99, epsilon: 1e-8, epsilon_root: 1e-16 }
    }
}

impl Optimizer for Adam {
    type State<B: Backend, const D: usize> = AdamState<B, D>;

    fn init<B: Backend, const D: usize>(&self, theta: &Tensor<B, D>) -> AdamState<B, D> {
        let zero = theta.zeros_like();
        AdamState { m: zero.clone(), v: zero, step: 0 }
    }

    fn step<B: Backend, const D: usize>(
        &self,
        theta: Tensor<B, D>,
        grad: Tensor<B, D>,
        state: AdamState<B, D>,
    ) -> (Tensor<B, D>, AdamState<B, D>) {
        let step = state.step + 1;
        let m = state.m * self.beta1 + grad.clone() * (1.0 - self.beta1);
        let v = state.v * self.beta2 + grad.clone() * grad * (1.0 - self.beta2);
        let [m_start, v_start] = [self.beta1, self.beta2].map(|beta| 1.0 - beta.powf(step as f64));
        // Not `v / v_start`: burn 0.21 differentiates a division by a number in f32.
        let root = (v.clone() * v_start.recip() + self.epsilon_root).sqrt() + self.epsilon;
        let theta = theta - m.clone() * (self.learning_rate / m_start) / root;
        (theta, AdamState { m, v, step })
    }

    fn tensors<B: Backend, const D: usize>(&self, state: AdamState<B, D>) -> Vec<Tensor<B, D>> {
        vec![state.m, state.v]
    }

    fn state<B: Backend, const D: usize>(
        &self,
        steps: usize,
        tensors: Vec<Tensor<B, D>>,
    ) -> AdamState<B, D> {
        let [m, v]: [_; 2] = tensors.try_into().expect("Adam remembers two tensors");
        AdamState { m, v, step: steps }
    }
}
