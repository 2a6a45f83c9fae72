use softrast_tensor::{Backend, Tensor};

/// What an inner loop minimises over `theta`, given `phi`; or what judges its result.
///
/// Generic over the backend, not per method: an objective that needs more of a backend than
/// `Backend` says so in its `impl`. An inner loop on `B` asks for an objective on `Autodiff<B>`, and
/// one that is learned through for `Autodiff<Autodiff<B>>`.
pub trait Objective<B: Backend> {
    /// The loss `[1]` of a scene `theta` `[N]` after `step` steps, from what
    /// [`prepared`](Objective::prepared) gave for it: a softness `phi` `[P]`, unless that says
    /// otherwise.
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, step: usize) -> Tensor<B, 1>;

    /// What the loss after `step` steps needs of `phi` `[P]`, flat: `phi` itself unless something
    /// costly can be worked out from it that does not depend on the scene.
    ///
    /// Meta-gradients go to it first, and through it only once for each [`stage`](Objective::stage).
    fn prepared(&self, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        phi
    }

    /// Steps with the same number in a row share what [`prepared`](Objective::prepared) gives.
    fn stage(&self, _step: usize) -> usize {
        0
    }

    /// The scene `[N]` nearest to `theta` `[N]` that is allowed: where every inner step ends.
    ///
    /// It is `theta` itself unless the scene has bounds.
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
