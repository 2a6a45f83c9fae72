use softrast_tensor::{Autodiff, Backend, Tensor, numbers};

use crate::{
    Objective, Optimizer,
    inner_loop::{allowed, gradient_of},
};

/// Derivatives of the outer loss with respect to the scene and the optimiser's state after some step.
pub(crate) struct Adjoint<B: Backend> {
    pub(crate) theta: Tensor<B, 1>,
    /// In the order of [`Optimizer::tensors`].
    pub(crate) state: Vec<Tensor<B, 1>>,
}

/// State before a step.
pub(crate) struct Stored<B: Backend> {
    pub(crate) step: usize,
    pub(crate) theta: Tensor<B, 1>,
    pub(crate) state: Vec<Tensor<B, 1>>,
}

impl<B: Backend> Adjoint<B> {
    pub(crate) fn norm(&self) -> f64 {
        norm(&numbers(self.theta.clone()))
    }

    /// Scales the adjoints of scene and state alike: they form one vector of a linear map.
    pub(crate) fn scale(self, factor: f64) -> Self {
        let state = self.state.into_iter().map(|x| x * factor).collect();
        Self { theta: self.theta * factor, state }
    }

    /// The adjoint before the stored step, and the derivative with respect to `prepared`.
    ///
    /// Only the tape of this one step exists, and it is freed on return.
    pub(crate) fn back<P, O>(
        self,
        objective: &P,
        optimizer: &O,
        before: Stored<B>,
        prepared: &Tensor<B, 1>,
    ) -> (Self, Tensor<B, 1>)
    where
        P: Objective<Autodiff<Autodiff<B>>>,
        O: Optimizer,
    {
        let leaf = |x: Tensor<B, 1>| Tensor::<Autodiff<B>, 1>::from_inner(x).require_grad();
        let (theta, prepared) = (leaf(before.theta), leaf(prepared.clone()));
        let state: Vec<_> = before.state.into_iter().map(leaf).collect();

        let grad = gradient_of(&theta, |theta| {
            objective.loss(theta, Tensor::from_inner(prepared.clone()), before.step)
        });
        let state_before = optimizer.state(before.step, state.clone());
        let (theta_after, state_after) = optimizer.step(theta.clone(), grad, state_before);
        let theta_after = allowed(objective, theta_after);

        let after = std::iter::once(theta_after).chain(optimizer.tensors(state_after));
        let adjoints = std::iter::once(self.theta).chain(self.state);
        let seeded = after.zip(adjoints).map(|(x, g)| (x * Tensor::from_inner(g)).sum());
        let product = seeded.reduce(|sum, term| sum + term).unwrap_or_else(|| theta.clone().sum());
        let grads = product.backward();
        let by = |x: &Tensor<Autodiff<B>, 1>| {
            x.grad(&grads).unwrap_or_else(|| x.clone().inner().zeros_like())
        };
        let before = Self { theta: by(&theta), state: state.iter().map(by).collect() };
        (before, by(&prepared))
    }
}

/// Euclidean norm, summed in f64.
pub(crate) fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}
