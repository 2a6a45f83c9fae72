use std::collections::VecDeque;

use burn::{
    backend::Autodiff,
    tensor::{Tensor, backend::Backend},
};

use crate::{
    BilevelProblem, MetaEstimate, Objective, Optimizer,
    adjoint::{Adjoint, Stored},
    numbers,
};

/// The outer loss where it was taken.
struct Taken<B: Backend> {
    step: usize,
    by_theta: Tensor<B, 1>,
}

/// The exact derivative of the outer loss by `phi` through the last `depth` inner steps, and where
/// the outer loss itself depends on `phi`, all of that too.
///
/// The inner loop runs without a tape. Then each step is repeated, last first, on a tape of its own,
/// so that memory holds the states of `depth` steps and the tape of one. With `clip`, the adjoint
/// of the scene is kept within so many times what the losses so far have put into it.
///
/// Source: docs/notes.md, Meta-gradients: Adam (the way back) and Meta-gradients: clipping.
pub(crate) fn unrolled<B, P, R, O>(
    problem: &BilevelProblem<B, P, R, O>,
    phi: &Tensor<B, 1>,
    depth: usize,
    clip: Option<f64>,
) -> MetaEstimate<B>
where
    B: Backend,
    P: Objective<Autodiff<Autodiff<B>>>,
    R: Objective<Autodiff<B>>,
    O: Optimizer,
{
    let optimizer = &problem.inner.optimizer;
    let at = problem.outer_steps.at(problem.inner.steps);
    let share = 1.0 / at.len() as f64;
    let (mut kept, mut taken) = (VecDeque::new(), Vec::new());
    let mut estimate = MetaEstimate::without_steps(0.0, phi.zeros_like());
    problem.walk(phi, |step, theta, state| {
        if at.contains(&step) {
            let (loss, by_theta, by_phi) = derivatives(&problem.outer_loss, theta, phi);
            estimate.loss += share * loss;
            estimate.gradient = estimate.gradient.clone() + by_phi * share;
            taken.push(Taken { step, by_theta: by_theta * share });
        }
        let state = optimizer.tensors(state.clone());
        kept.push_back(Stored { step, theta: theta.clone(), state });
        // The last one is the solution, which no step goes on from.
        if kept.len() > depth + 1 {
            kept.pop_front();
        }
    });
    let Some(end) = kept.pop_back() else { return estimate };
    estimate.stored = kept.iter().map(|x| x.theta.dims()[0] * (1 + x.state.len())).sum();

    let state = end.state.iter().map(Tensor::zeros_like).collect();
    let mut adjoint = Adjoint { theta: end.theta.zeros_like(), state };
    // Not more than the losses put in, if no step amplified it.
    let mut put_in = 0.0;
    let mut put = |step: usize, adjoint: &mut Adjoint<B>| {
        while let Some(loss) = taken.pop_if(|loss| loss.step == step) {
            let seed = Adjoint { theta: loss.by_theta.clone(), state: Vec::new() };
            put_in += seed.norm();
            adjoint.theta = adjoint.theta.clone() + loss.by_theta;
        }
        put_in
    };
    put(end.step, &mut adjoint);
    let mut norm = adjoint.norm();
    if !kept.is_empty() {
        estimate.adjoint_norms.push(norm);
    }
    let mut prepared: Option<Prepared<B>> = None;
    while let Some(before) = kept.pop_back() {
        let step = before.step;
        let stage = problem.objective.stage(step);
        if prepared.as_ref().is_none_or(|prepared| prepared.stage != stage) {
            let next = Prepared::new(&problem.objective, phi, step, stage);
            let last = prepared.replace(next).map(Prepared::by_phi);
            estimate.gradient = last.into_iter().fold(estimate.gradient, |sum, by| sum + by);
        }
        let Some(now) = &mut prepared else { break };
        let (earlier, by_prepared) =
            adjoint.back(&problem.objective, optimizer, before, &now.value);
        adjoint = earlier;
        now.adjoint = now.adjoint.clone() + by_prepared;
        let grown = adjoint.norm();
        if norm > 0.0 && grown > 0.0 {
            estimate.adjoint_growth += (grown / norm).log10();
        }
        let limit = put(step, &mut adjoint);
        norm = adjoint.norm();
        estimate.adjoint_norms.push(norm);
        if let Some(clip) = clip.filter(|clip| norm > clip * limit) {
            adjoint = adjoint.scale(clip * limit / norm);
            norm = clip * limit;
            estimate.clips += 1;
        }
    }
    let last = prepared.map(Prepared::by_phi);
    estimate.gradient = last.into_iter().fold(estimate.gradient, |sum, by| sum + by);
    estimate
}

/// What some steps in a row need of φ.
struct Prepared<B: Backend> {
    stage: usize,
    phi: Tensor<Autodiff<B>, 1>,
    tracked: Tensor<Autodiff<B>, 1>,
    value: Tensor<B, 1>,
    /// Derivative of the outer loss by it, through the steps walked back so far.
    adjoint: Tensor<B, 1>,
}

impl<B: Backend> Prepared<B> {
    fn new<P: Objective<Autodiff<Autodiff<B>>>>(
        objective: &P,
        phi: &Tensor<B, 1>,
        step: usize,
        stage: usize,
    ) -> Self {
        let phi = Tensor::<Autodiff<B>, 1>::from_inner(phi.clone()).require_grad();
        let tracked = objective.prepared(Tensor::from_inner(phi.clone()), step).inner();
        let value = tracked.clone().inner();
        Self { stage, phi, tracked, adjoint: value.zeros_like(), value }
    }

    /// The derivative by φ itself.
    fn by_phi(self) -> Tensor<B, 1> {
        let grads = (self.tracked * Tensor::from_inner(self.adjoint)).sum().backward();
        self.phi.grad(&grads).unwrap_or_else(|| self.phi.inner().zeros_like())
    }
}

/// The loss, and its derivatives by the scene and by the softness.
fn derivatives<B: Backend>(
    loss: &impl Objective<Autodiff<B>>,
    theta: &Tensor<B, 1>,
    phi: &Tensor<B, 1>,
) -> (f64, Tensor<B, 1>, Tensor<B, 1>) {
    let leaf = |x: &Tensor<B, 1>| Tensor::<Autodiff<B>, 1>::from_inner(x.clone()).require_grad();
    let (tracked_theta, tracked_phi) = (leaf(theta), leaf(phi));
    let loss = loss.loss(tracked_theta.clone(), tracked_phi.clone());
    let value = numbers(loss.clone().inner()).iter().sum();
    let grads = loss.backward();
    let by_theta = tracked_theta.grad(&grads).unwrap_or_else(|| theta.zeros_like());
    let by_phi = tracked_phi.grad(&grads).unwrap_or_else(|| phi.zeros_like());
    (value, by_theta, by_phi)
}
