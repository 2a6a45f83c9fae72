use std::collections::VecDeque;

use softrast_tensor::{Autodiff, Backend, Tensor, numbers};

use crate::{
    BilevelProblem, MetaEstimate, Objective, Optimizer,
    adjoint::{Adjoint, Stored, norm},
    objective::loss_under,
};

/// The exact derivative of the outer loss with respect to `phi` through the last `depth` inner
/// steps, plus the explicit dependence of the outer loss on `phi`.
///
/// The inner loop runs without a tape. Then each step is repeated, last first, on a separate tape:
/// memory holds the states of `depth` steps and the tape of one. `clip` limits the norm of the
/// adjoint of the scene to this multiple of the summed norms of the loss gradients added so far.
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
    let Run { mut states, taken, mut estimate } = run(problem, phi, depth);
    let Some(end) = states.pop() else { return estimate };
    estimate.stored = states.iter().map(|x| x.theta.dims()[0] * (1 + x.state.len())).sum();
    let mut back = WayBack::from(&end, taken);
    if !states.is_empty() {
        estimate.adjoint_norms.push(back.norm);
    }
    let objective = &problem.objective;
    while let Some(last) = states.last() {
        let stage = objective.stage(last.step);
        let mut prepared = Prepared::new(objective, phi, last.step);
        while let Some(before) = states.pop_if(|x| objective.stage(x.step) == stage) {
            back = back
                .over(problem, before, &mut prepared, &mut estimate)
                .clipped(clip, &mut estimate);
        }
        estimate.gradient = estimate.gradient + prepared.by_phi();
    }
    estimate
}

/// Result of an inner loop, as input of the backward pass.
struct Run<B: Backend> {
    /// The states before the last steps, and the final state.
    states: Vec<Stored<B>>,
    taken: Vec<Taken<B>>,
    /// The loss, and its explicit derivative with respect to the softness.
    estimate: MetaEstimate<B>,
}

/// Gradient of the outer loss at one of its steps.
struct Taken<B: Backend> {
    step: usize,
    by_theta: Tensor<B, 1>,
}

fn run<B, P, R, O>(problem: &BilevelProblem<B, P, R, O>, phi: &Tensor<B, 1>, depth: usize) -> Run<B>
where
    B: Backend,
    P: Objective<Autodiff<Autodiff<B>>>,
    R: Objective<Autodiff<B>>,
    O: Optimizer,
{
    let at = problem.outer_steps.at(problem.inner.steps);
    let share = 1.0 / at.len() as f64;
    let (mut states, mut taken) = (VecDeque::new(), Vec::new());
    let mut estimate = MetaEstimate::without_steps(0.0, phi.zeros_like());
    problem.walk(phi, |step, theta, state| {
        if at.contains(&step) {
            let (loss, by_theta, by_phi) = derivatives(&problem.outer_loss, theta, phi, step);
            estimate.loss += share * loss;
            estimate.gradient = estimate.gradient.clone() + by_phi * share;
            taken.push(Taken { step, by_theta: by_theta * share });
        }
        let state = problem.inner.optimizer.tensors(state.clone());
        states.push_back(Stored { step, theta: theta.clone(), state });
        if states.len() > depth + 1 {
            states.pop_front();
        }
    });
    Run { states: states.into(), taken, estimate }
}

/// The adjoint during the backward pass.
struct WayBack<B: Backend> {
    adjoint: Adjoint<B>,
    norm: f64,
    /// Loss gradients not yet added, in ascending order of steps.
    left: Vec<Taken<B>>,
    /// Summed norms of the loss gradients added so far.
    put_in: f64,
}

impl<B: Backend> WayBack<B> {
    /// The adjoint at the end of the inner loop.
    fn from(end: &Stored<B>, taken: Vec<Taken<B>>) -> Self {
        let state = end.state.iter().map(Tensor::zeros_like).collect();
        let adjoint = Adjoint { theta: end.theta.zeros_like(), state };
        Self { adjoint, norm: 0.0, left: taken, put_in: 0.0 }.with_losses_at(end.step)
    }

    fn with_losses_at(mut self, step: usize) -> Self {
        while let Some(loss) = self.left.pop_if(|loss| loss.step == step) {
            self.put_in += norm(&numbers(loss.by_theta.clone()));
            self.adjoint.theta = self.adjoint.theta + loss.by_theta;
        }
        Self { norm: self.adjoint.norm(), ..self }
    }

    /// Propagates the adjoint to before a step.
    fn over<P, R, O>(
        self,
        problem: &BilevelProblem<B, P, R, O>,
        before: Stored<B>,
        prepared: &mut Prepared<B>,
        estimate: &mut MetaEstimate<B>,
    ) -> Self
    where
        P: Objective<Autodiff<Autodiff<B>>>,
        O: Optimizer,
    {
        let (objective, optimizer, step) =
            (&problem.objective, &problem.inner.optimizer, before.step);
        let (adjoint, by_prepared) =
            self.adjoint.back(objective, optimizer, before, &prepared.value);
        prepared.adjoint = prepared.adjoint.clone() + by_prepared;
        let grown = adjoint.norm();
        if self.norm > 0.0 && grown > 0.0 {
            estimate.adjoint_growth += (grown / self.norm).log10();
        }
        let earlier = Self { adjoint, ..self }.with_losses_at(step);
        estimate.adjoint_norms.push(earlier.norm);
        earlier
    }

    /// Clips the norm to `clip` times that of the loss gradients added, a bound that holds if no step amplifies the adjoint.
    fn clipped(self, clip: Option<f64>, estimate: &mut MetaEstimate<B>) -> Self {
        match clip.map(|clip| clip * self.put_in).filter(|limit| self.norm > *limit) {
            None => self,
            Some(limit) => {
                estimate.clips += 1;
                Self { adjoint: self.adjoint.scale(limit / self.norm), norm: limit, ..self }
            }
        }
    }
}

/// The result of `prepared`, shared by consecutive steps of one stage.
struct Prepared<B: Backend> {
    phi: Tensor<Autodiff<B>, 1>,
    tracked: Tensor<Autodiff<B>, 1>,
    value: Tensor<B, 1>,
    /// Derivative of the outer loss with respect to `value`, through the steps differentiated so far.
    adjoint: Tensor<B, 1>,
}

impl<B: Backend> Prepared<B> {
    fn new<P: Objective<Autodiff<Autodiff<B>>>>(
        objective: &P,
        phi: &Tensor<B, 1>,
        step: usize,
    ) -> Self {
        let phi = Tensor::<Autodiff<B>, 1>::from_inner(phi.clone()).require_grad();
        let tracked = objective.prepared(Tensor::from_inner(phi.clone()), step).inner();
        let value = tracked.clone().inner();
        Self { phi, tracked, adjoint: value.zeros_like(), value }
    }

    /// The derivative with respect to φ itself.
    fn by_phi(self) -> Tensor<B, 1> {
        let grads = (self.tracked * Tensor::from_inner(self.adjoint)).sum().backward();
        self.phi.grad(&grads).unwrap_or_else(|| self.phi.inner().zeros_like())
    }
}

/// The loss, and its derivatives with respect to the scene and the softness.
fn derivatives<B: Backend>(
    loss: &impl Objective<Autodiff<B>>,
    theta: &Tensor<B, 1>,
    phi: &Tensor<B, 1>,
    step: usize,
) -> (f64, Tensor<B, 1>, Tensor<B, 1>) {
    let leaf = |x: &Tensor<B, 1>| Tensor::<Autodiff<B>, 1>::from_inner(x.clone()).require_grad();
    let (tracked_theta, tracked_phi) = (leaf(theta), leaf(phi));
    let loss = loss_under(loss, tracked_theta.clone(), tracked_phi.clone(), step);
    let value = numbers(loss.clone().inner()).iter().sum();
    let grads = loss.backward();
    let by_theta = tracked_theta.grad(&grads).unwrap_or_else(|| theta.zeros_like());
    let by_phi = tracked_phi.grad(&grads).unwrap_or_else(|| phi.zeros_like());
    (value, by_theta, by_phi)
}
