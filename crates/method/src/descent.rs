use std::time::Instant;

use burn::{
    backend::Autodiff,
    tensor::{Tensor, backend::Backend},
};
use softrast_meta::Optimizer;

/// Steps down the gradient of a loss, watched one by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent<O> {
    /// How a step is taken.
    pub optimizer: O,
    /// How many are taken.
    pub steps: usize,
}

/// Where a descent is after some steps.
#[derive(Debug)]
pub struct Moment<B: Backend, const D: usize, S> {
    /// Steps taken so far.
    pub step: usize,
    /// The parameters.
    pub theta: Tensor<B, D>,
    /// The losses there, as the objective gave them.
    pub loss: Tensor<B, 1>,
    /// What the objective saw on the way to them.
    pub seen: S,
    /// Time of the step that ended here, in seconds; none before the first.
    pub seconds: Option<f64>,
}

impl<O: Optimizer> Descent<O> {
    /// Goes down from `start`, and shows every place from the start to the end to `visit`.
    ///
    /// `objective` gives for a step and the parameters one loss or several, whose sum is lowered,
    /// and whatever else `visit` should see. After a step `allowed` moves the parameters to where
    /// they may be. Parameters without a gradient, as where nothing was drawn, stay as they are.
    /// `visit` does not count as time of a step.
    ///
    /// # Errors
    ///
    /// Those of `visit` and of the device, which end the descent.
    pub fn run<B: Backend, const D: usize, S>(
        &self,
        start: Tensor<B, D>,
        mut objective: impl FnMut(usize, Tensor<Autodiff<B>, D>) -> (Tensor<Autodiff<B>, 1>, S),
        allowed: impl Fn(Tensor<B, D>) -> Tensor<B, D>,
        mut visit: impl FnMut(Moment<B, D, S>) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let mut state = self.optimizer.init(&start);
        let (mut theta, mut seconds) = (start, None);
        for step in 0..=self.steps {
            let clock = Instant::now();
            let leaf = Tensor::from_inner(theta.clone()).require_grad();
            let (loss, seen) = objective(step, leaf.clone());
            // A GPU has only been asked so far, also for the end of the step before.
            B::sync(&theta.device())?;
            let mut time = clock.elapsed();
            let inner = loss.clone().inner();
            visit(Moment { step, theta: theta.clone(), loss: inner, seen, seconds })?;
            if step == self.steps {
                break;
            }
            let clock = Instant::now();
            let grads = loss.sum().backward();
            let grad = leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like());
            let (moved, next) = self.optimizer.step(theta, grad, state);
            (theta, state) = (allowed(moved), next);
            time += clock.elapsed();
            seconds = Some(time.as_secs_f64());
        }
        Ok(())
    }
}
