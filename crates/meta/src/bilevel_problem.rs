use std::convert::Infallible;

use softrast_tensor::{Autodiff, Backend, Tensor, numbers};

use crate::{
    InnerLoop, Objective, Optimizer, OuterSteps, descend,
    inner_loop::{allowed, gradient},
    objective::loss_under,
};

/// One instance of a task, to learn a softness on: what is optimised, and how the result is judged.
#[derive(Clone, Debug)]
pub struct BilevelProblem<B: Backend, P, R, O> {
    /// What the inner loop minimises, under the softness that is learned; on the level of autodiff that second derivatives need.
    pub objective: P,
    /// The outer loss. It should not depend on φ, or a wide softness looks better than it is
    /// (docs/notes.md, Outer loss); the paper takes the objective itself.
    pub outer_loss: R,
    /// How the inner loop steps, and how often.
    pub inner: InnerLoop<O>,
    /// Where it starts, `[N]`.
    pub start: Tensor<B, 1>,
    /// When the outer loss is taken.
    pub outer_steps: OuterSteps,
}

impl<B, P, R, O> BilevelProblem<B, P, R, O>
where
    B: Backend,
    P: Objective<Autodiff<Autodiff<B>>>,
    R: Objective<Autodiff<B>>,
    O: Optimizer,
{
    /// The outer loss that the inner loop under `phi` `[P]` comes to.
    pub fn loss(&self, phi: &Tensor<B, 1>) -> f64 {
        let at = self.outer_steps.at(self.inner.steps);
        let mut total = 0.0;
        self.walk(phi, |step, theta, _| {
            if at.contains(&step) {
                total += self.judged(theta, phi, step);
            }
        });
        total / at.len() as f64
    }

    /// The outer loss of a scene after some steps.
    pub(crate) fn judged(&self, theta: &Tensor<B, 1>, phi: &Tensor<B, 1>, step: usize) -> f64 {
        let [theta, phi] = [theta, phi].map(|x| Tensor::from_inner(x.clone()));
        numbers(loss_under(&self.outer_loss, theta, phi, step).inner()).iter().sum()
    }
}

impl<B: Backend, P: Objective<Autodiff<Autodiff<B>>>, R, O: Optimizer> BilevelProblem<B, P, R, O> {
    /// Runs the inner loop, showing the scene and the optimiser's state before the first step and
    /// after each.
    pub(crate) fn walk(
        &self,
        phi: &Tensor<B, 1>,
        see: impl FnMut(usize, &Tensor<B, 1>, &O::State<B, 1>),
    ) {
        let gradient = |step: usize, theta: &Tensor<B, 1>| {
            let [at, phi] = [theta, phi].map(|x| Tensor::<Autodiff<B>, 1>::from_inner(x.clone()));
            // On the level of the way back: what the objective detaches, it detaches there.
            Ok(gradient(&self.objective, at, phi, step).inner())
        };
        let allowed = |theta| allowed(&self.objective, Tensor::from_inner(theta)).inner();
        let Ok::<_, Infallible>(_) =
            descend(&self.inner, self.start.clone(), gradient, allowed, see);
    }
}
