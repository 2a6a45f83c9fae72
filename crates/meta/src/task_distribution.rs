use softrast_tensor::{Autodiff, Backend, Tensor};

use crate::{BilevelProblem, Objective, Optimizer};

/// What a softness is learned on: instances by seed.
pub trait TaskDistribution<B: Backend> {
    /// What the inner loops minimise.
    type Objective: Objective<Autodiff<Autodiff<B>>>;
    /// What judges their results.
    type OuterLoss: Objective<Autodiff<B>>;
    /// What steps them.
    type Optimizer: Optimizer;

    /// The instance with this seed, always the same one; prepared for softnesses near `phi` `[P]`.
    fn problem(
        &self,
        seed: u64,
        phi: &Tensor<B, 1>,
    ) -> BilevelProblem<B, Self::Objective, Self::OuterLoss, Self::Optimizer>;

    /// The outer loss of `phi` `[P]` on the instance with this seed, for what needs no derivative of it.
    fn loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.problem(seed, phi).loss(phi)
    }

    /// The loss by which `phi` `[P]` is judged on the instance with this seed, in validation.
    ///
    /// It is the outer loss unless that may flatter some softnesses.
    fn validation_loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.loss(seed, phi)
    }
}
