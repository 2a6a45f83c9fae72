use burn::{
    backend::Autodiff,
    tensor::{Tensor, backend::Backend},
};

use crate::{
    InnerLoop, Measured, Objective, Optimizer, gradient, inner_loop::allowed, vector::numbers,
};

/// One instance of a task, to learn a softness on: what is optimised, and how the result is judged.
#[derive(Clone, Debug)]
pub struct Problem<B: Backend, P, R, O> {
    /// What the inner loop minimises, under the softness that is learned.
    pub objective: P,
    /// The outer loss. It should not depend on φ, or a wide softness flatters itself (META finding 9);
    /// the paper takes the objective itself.
    pub referee: R,
    /// How the inner loop steps, and how often.
    pub inner: InnerLoop<O>,
    /// Where it starts, `[N]`.
    pub start: Tensor<B, 1>,
    /// When the outer loss is taken.
    pub measured: Measured,
}

impl<B, P, R, O> Problem<B, P, R, O>
where
    B: Backend,
    P: Objective<Autodiff<B>>,
    R: Objective<B>,
    O: Optimizer,
{
    /// The outer loss that the inner loop under `phi` `[P]` comes to.
    pub fn loss(&self, phi: &Tensor<B, 1>) -> f64 {
        let at = self.measured.at(self.inner.steps);
        let mut total = 0.0;
        self.walk(phi, |step, theta, _| {
            if at.contains(&step) {
                let loss = self.referee.loss(theta.clone(), phi.clone());
                total += numbers(loss).iter().sum::<f64>();
            }
        });
        total / at.len() as f64
    }
}

impl<B: Backend, P: Objective<Autodiff<B>>, R, O: Optimizer> Problem<B, P, R, O> {
    /// Runs the inner loop, showing the scene and the optimiser's state before the first step and
    /// after each.
    pub(crate) fn walk(
        &self,
        phi: &Tensor<B, 1>,
        mut see: impl FnMut(usize, &Tensor<B, 1>, &O::State<B, 1>),
    ) {
        let optimizer = &self.inner.optimizer;
        let mut state = optimizer.init(&self.start);
        let mut theta = self.start.clone();
        see(0, &theta, &state);
        for step in 0..self.inner.steps {
            let grad = gradient(&self.objective, theta.clone(), phi.clone(), step);
            (theta, state) = optimizer.step(theta, grad, state);
            theta = allowed(&self.objective, theta);
            see(step + 1, &theta, &state);
        }
    }
}
