use burn::{
    backend::Autodiff,
    tensor::{Tensor, backend::Backend},
};

/// What an inner loop minimises over `theta`, given `phi`.
///
/// Generic over the backend, not per method: an objective that needs more of a backend than
/// `Backend` says so in its `impl`. An inner loop on `B` asks for an objective on `Autodiff<B>`, and
/// one that is learned through for `Autodiff<Autodiff<B>>`.
pub trait Objective<B: Backend> {
    /// The loss `[1]` of a scene `theta` `[N]` under a softness `phi` `[P]`.
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>) -> Tensor<B, 1>;

    /// The loss `[1]` whose gradient the inner step number `step`, counted from 0, goes down.
    ///
    /// It is [`loss`](Objective::loss) unless the softness changes from step to step.
    fn loss_at(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        self.loss(theta, phi)
    }

    /// What the loss at inner step `step` needs of `phi` `[P]`, flat: `phi` itself unless something
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

    /// [`loss_at`](Objective::loss_at) from what [`prepared`](Objective::prepared) gave.
    fn loss_from(&self, theta: Tensor<B, 1>, prepared: Tensor<B, 1>, step: usize) -> Tensor<B, 1> {
        self.loss_at(theta, prepared, step)
    }

    /// The scene `[N]` nearest to `theta` `[N]` that is allowed: where every inner step ends.
    ///
    /// It is `theta` itself unless the scene has bounds.
    fn allowed(&self, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        theta
    }
}

/// An objective one level of autodiff below its own: what is tracked there is tracked here, and the level above sees constants.
pub(crate) struct Lowered<'a, P>(pub(crate) &'a P);

impl<B: Backend, P: Objective<Autodiff<B>>> Objective<B> for Lowered<'_, P> {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>) -> Tensor<B, 1> {
        self.0.loss(Tensor::from_inner(theta), Tensor::from_inner(phi)).inner()
    }

    fn loss_at(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, step: usize) -> Tensor<B, 1> {
        self.0.loss_at(Tensor::from_inner(theta), Tensor::from_inner(phi), step).inner()
    }

    fn allowed(&self, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        self.0.allowed(Tensor::from_inner(theta)).inner()
    }
}
