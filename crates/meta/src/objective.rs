use burn::tensor::{Tensor, backend::Backend};

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

    /// The scene `[N]` nearest to `theta` `[N]` that is allowed: where every inner step ends.
    ///
    /// It is `theta` itself unless the scene has bounds.
    fn allowed(&self, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        theta
    }
}
