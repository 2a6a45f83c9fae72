use std::convert::Infallible;

use burn::{
    backend::Autodiff,
    tensor::{Tensor, backend::Backend},
};

use crate::{
    InnerLoop, Objective, Optimizer, OuterSteps, descend, gradient, inner_loop::allowed, numbers,
    objective::Lowered,
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
                let loss = Lowered(&self.outer_loss).loss(theta.clone(), phi.clone());
                total += numbers(loss).iter().sum::<f64>();
            }
        });
        total / at.len() as f64
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
        let objective = Lowered(&self.objective);
        let allowed = |theta| allowed(&objective, theta);
        let Ok::<_, Infallible>(_) =
            descend(&self.inner, self.start.clone(), gradient, allowed, see);
    }
}
