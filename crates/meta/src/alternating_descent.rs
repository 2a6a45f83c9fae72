use std::convert::Infallible;

use burn::{
    backend::Autodiff,
    tensor::{Tensor, backend::Backend},
};

use crate::{
    Adam, BilevelProblem, InnerLoop, MetaEstimate, Objective, Optimizer, descend,
    inner_loop::allowed, numbers, objective::Lowered,
};

/// An inner loop that moves the softness along with the scene, down the same loss.
///
/// No meta-learning at all, and what the released pose code does: the baseline that meta-learning
/// has to beat. Source: docs/notes.md, Joint softness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlternatingDescent<O, S> {
    /// How the scene is stepped, and how often.
    pub inner: InnerLoop<O>,
    /// How the softness is stepped, at a learning rate of its own.
    pub softness: S,
}

impl<O: Optimizer, S: Optimizer> AlternatingDescent<O, S> {
    /// The scene and the softness reached from `theta` `[N]` and `phi` `[P]`.
    pub fn solve<B: Backend, P: Objective<Autodiff<B>>>(
        &self,
        objective: &P,
        theta: Tensor<B, 1>,
        phi: Tensor<B, 1>,
    ) -> (Tensor<B, 1>, Tensor<B, 1>) {
        solve(&self.inner, &self.softness, objective, theta, phi)
    }
}

fn solve<B, P, O, S>(
    inner: &InnerLoop<O>,
    softness: &S,
    objective: &P,
    theta: Tensor<B, 1>,
    mut phi: Tensor<B, 1>,
) -> (Tensor<B, 1>, Tensor<B, 1>)
where
    B: Backend,
    P: Objective<Autodiff<B>>,
    O: Optimizer,
    S: Optimizer,
{
    let mut state = softness.init(&phi);
    let gradient = |step: usize, theta: &Tensor<B, 1>| {
        let [leaf, soft] =
            [theta, &phi].map(|x| Tensor::<Autodiff<B>, 1>::from_inner(x.clone()).require_grad());
        let grads = objective.loss_at(leaf.clone(), soft.clone(), step).backward();
        let soft_grad = soft.grad(&grads).unwrap_or_else(|| phi.zeros_like());
        (phi, state) = softness.step(phi.clone(), soft_grad, state.clone());
        Ok(leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like()))
    };
    let Ok::<_, Infallible>(theta) =
        descend(inner, theta, gradient, |theta| allowed(objective, theta), |_, _, _| ());
    (theta, phi)
}

/// The outer loss after a joint loop from `phi` `[P]`, and how far `phi` was left behind.
pub(crate) fn joint<B, P, R, O>(
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
    let BilevelProblem { objective, outer_loss, inner, start, .. } = problem;
    let softness = Adam::new(learning_rate);
    let (theta, end) = solve(inner, &softness, &Lowered(objective), start.clone(), phi.clone());
    let loss = numbers(Lowered(outer_loss).loss(theta, end.clone())).iter().sum();
    MetaEstimate::without_steps(loss, phi.clone() - end)
}
