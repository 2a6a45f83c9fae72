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

#[cfg(test)]
mod tests {
    use burn::backend::NdArray;
    use softrast_meta::Sgd;

    use super::*;
    use crate::{numbers, tensor};

    type B = NdArray<f64>;

    /// Places of a descent in `θ²` of two parameters that may not fall below `floor`.
    fn places(start: [f64; 2], floor: f64) -> Vec<Vec<f64>> {
        let descent = Descent { optimizer: Sgd { learning_rate: 0.25 }, steps: 2 };
        let mut places = Vec::new();
        let square = |step, theta: Tensor<Autodiff<B>, 1>| (theta.clone() * theta, step);
        let visit = |now: Moment<B, 1, usize>| {
            assert_eq!((now.step, now.step > 0), (now.seen, now.seconds.is_some()));
            let squares = numbers(now.theta.clone() * now.theta.clone());
            assert_eq!(numbers(now.loss), squares);
            places.push(numbers(now.theta));
            Ok(())
        };
        let start = tensor::<B, 1>(start.to_vec(), [2]);
        descent.run(start, square, |theta| theta.clamp_min(floor), visit).unwrap();
        places
    }

    #[test]
    fn every_place_from_the_start_to_the_end_is_seen_once() {
        let expected = [[4.0, -8.0], [2.0, -4.0], [1.0, -2.0]];
        assert_eq!(places([4.0, -8.0], -10.0), expected);
    }

    #[test]
    fn a_step_ends_where_it_is_allowed_to() {
        assert_eq!(places([4.0, 8.0], 3.0), [[4.0, 8.0], [3.0, 4.0], [3.0, 3.0]]);
    }

    #[test]
    fn parameters_without_a_gradient_stay_and_an_error_ends_the_descent() {
        let descent = Descent { optimizer: Sgd { learning_rate: 1.0 }, steps: 5 };
        let mut seen = 0;
        let constant = |_, theta: Tensor<Autodiff<B>, 1>| (theta.detach(), ());
        let visit = |now: Moment<B, 1, ()>| {
            assert_eq!(numbers(now.theta), [7.0]);
            seen += 1;
            anyhow::ensure!(seen < 3, "enough");
            Ok(())
        };
        let end = descent.run(tensor::<B, 1>(vec![7.0], [1]), constant, |theta| theta, visit);
        assert_eq!(end.unwrap_err().to_string(), "enough");
        assert_eq!(seen, 3);
    }
}
