use softrast_tensor::{Autodiff, Backend, Tensor};

use crate::{BilevelProblem, Objective, Optimizer};

/// A distribution of instances to learn a softness on, indexed by seed.
///
/// See [`OuterLoop`](crate::OuterLoop) for an example.
pub trait TaskDistribution<B: Backend> {
    /// Loss of the inner loops.
    type Objective: Objective<Autodiff<Autodiff<B>>>;
    /// Loss of their results.
    type OuterLoss: Objective<Autodiff<B>>;
    /// Optimiser of the inner loops.
    type Optimizer: Optimizer;

    /// The instance with this seed, always the same; prepared for softnesses near `phi` `[P]`.
    fn problem(
        &self,
        seed: u64,
        phi: &Tensor<B, 1>,
    ) -> BilevelProblem<B, Self::Objective, Self::OuterLoss, Self::Optimizer>;

    /// The outer loss of `phi` `[P]` on the instance with this seed, without derivatives.
    fn loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.problem(seed, phi).loss(phi)
    }

    /// The validation loss of `phi` `[P]` on the instance with this seed.
    ///
    /// By default the outer loss; override it if that is biased towards some softnesses.
    fn validation_loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.loss(seed, phi)
    }
}
