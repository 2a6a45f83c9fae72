use softrast_tensor::{Backend, Tensor};

/// A loss of `theta` given `phi`, minimised by an inner loop or used as outer loss.
///
/// Generic over the backend, not per method: an objective that needs more of a backend than
/// `Backend` declares that in its `impl`. An inner loop on `B` needs an objective on `Autodiff<B>`,
/// and one to differentiate through an objective on `Autodiff<Autodiff<B>>`.
pub trait Objective<B: Backend> {
    /// The loss `[1]` of a scene `theta` `[N]` after `step` steps. `phi` is the result of
    /// [`prepared`](Objective::prepared) for this step: by default the softness `[P]` itself.
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, step: usize) -> Tensor<B, 1>;

    /// Precomputes from `phi` `[P]` the flat input of the loss after `step` steps: by default `phi` itself. Use it for costly work that
    /// does not depend on the scene.
    ///
    /// Meta-gradients are accumulated with respect to it, and backpropagated through it once per [`stage`](Objective::stage).
    fn prepared(&self, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        phi
    }

    /// Stage of a step. Consecutive steps of one stage share the result of [`prepared`](Objective::prepared).
    fn stage(&self, _step: usize) -> usize {
        0
    }

    /// Projects `theta` `[N]` onto the feasible scenes, after every inner step.
    ///
    /// By default it returns `theta`: the scene has no bounds.
    fn allowed(&self, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        theta
    }
}

/// The loss `[1]` of a scene `theta` `[N]` after `step` steps under a softness `phi` `[P]`.
pub(crate) fn loss_under<B: Backend>(
    objective: &impl Objective<B>,
    theta: Tensor<B, 1>,
    phi: Tensor<B, 1>,
    step: usize,
) -> Tensor<B, 1> {
    objective.loss(theta, objective.prepared(phi, step), step)
}
