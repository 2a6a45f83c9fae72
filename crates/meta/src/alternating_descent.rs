use std::convert::Infallible;

use softrast_tensor::{Autodiff, Backend, Tensor};

use crate::{
    Adam, BilevelProblem, MetaEstimate, Objective, Optimizer, descend, inner_loop::allowed,
    objective::loss_under,
};

/// The outer loss after an inner loop that optimises the softness jointly with the scene on the
/// inner loss, and `phi` `[P]` minus the final softness.
///
/// The baseline without meta-learning, as in the released pose code. Source: docs/notes.md, Joint
/// softness.
pub(crate) fn alternating_descent<B, P, R, O>(
    problem: &BilevelProblem<B, P, R, O>,
    phi: &Tensor<B, 1>,
    learning_rate: f64,
) -> MetaEstimate<B>
where
    B: Backend,
    P: Objective<Autodiff<Autodiff<B>>>,
    R: Objective<Autodiff<B>>,
    O: Optimizer,
{
    let BilevelProblem { objective, inner, start, .. } = problem;
    // At the autodiff level of the backward pass, as in other inner loops.
    let [start, mut end] = [start, phi].map(|x| Tensor::<Autodiff<B>, 1>::from_inner(x.clone()));
    let adam = Adam::new(learning_rate);
    let mut state = adam.init(&end);
    let gradient = |step: usize, theta: &Tensor<Autodiff<B>, 1>| {
        let [leaf, soft] = [theta, &end].map(|x| Tensor::from_inner(x.clone()).require_grad());
        let grads = loss_under(objective, leaf.clone(), soft.clone(), step).backward();
        let soft_grad = soft.grad(&grads).unwrap_or_else(|| end.zeros_like());
        (end, state) = adam.step(end.clone(), soft_grad, state.clone());
        Ok(leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like()))
    };
    let allowed = |theta| allowed(objective, theta);
    let Ok::<_, Infallible>(theta) = descend(inner, start, gradient, allowed, |_, _, _| ());
    let (theta, end) = (theta.inner(), end.inner());
    MetaEstimate::without_steps(problem.judged(&theta, &end, inner.steps), phi.clone() - end)
}
