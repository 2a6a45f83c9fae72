use serde::Serialize;
use softrast_tensor::{Autodiff, Backend, Tensor};

use crate::{
    BilevelProblem, MetaEstimate, Objective, Optimizer, TaskDistribution,
    alternating_descent::alternating_descent, evolution::evolution, unrolled::unrolled,
};

/// Estimator of the derivative of the outer loss with respect to the softness.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MetaGradient {
    /// Exact second order, through every inner step.
    Unrolled {
        /// Limit of the adjoint, as a multiple of the contribution of the outer loss. `None` gives
        /// the exact gradient, which beyond some ten steps of Adam is often useless (docs/notes.md,
        /// Meta-gradients: chaos).
        clip: Option<f64>,
    },
    /// [`Unrolled`](MetaGradient::Unrolled) through the last steps only.
    Truncated {
        /// Number of steps; 0 gives [`Direct`](MetaGradient::Direct).
        steps: usize,
        /// As for [`Unrolled`](MetaGradient::Unrolled).
        clip: Option<f64>,
    },
    /// The partial derivative of the outer loss with respect to φ, with the solution held constant,
    /// as in the released shape code. Zero for an outer loss that ignores φ.
    Direct,
    /// An antithetic evolution strategy: differences of whole inner loops, no derivatives. It
    /// follows the outer loss smoothed by a normal distribution.
    EvolutionStrategy {
        /// Standard deviation of the perturbations of φ, the same for every parameter.
        sigma: f64,
        /// Pairs of inner loops.
        pairs: usize,
    },
    /// The softness is optimised jointly with the scene on the inner loss, without a derivative of
    /// the outer loss, as in the released pose code. The "gradient" is φ at the start minus φ at
    /// the end, and an [`OuterLoop`](crate::OuterLoop) subtracts all of it.
    AlternatingDescent {
        /// Rate of the Adam that moves φ, once per inner step.
        learning_rate: f64,
    },
}

impl Default for MetaGradient {
    /// [`Unrolled`](MetaGradient::Unrolled), with the adjoint clipped to the contribution of the outer loss.
    ///
    /// Source: docs/notes.md, Meta-gradients: clipping. The accuracy of its sign on the tasks is in
    /// docs/studies/estimators.md.
    fn default() -> Self {
        Self::Unrolled { clip: Some(1.0) }
    }
}

impl MetaGradient {
    /// The outer loss of `problem` under `phi` `[P]` and its derivative.
    ///
    /// `seed` seeds the noise of an [evolution strategy](MetaGradient::EvolutionStrategy); other estimators ignore it. Memory holds the
    /// tape of one inner step, and the scene and the optimiser's state before each differentiated step.
    ///
    /// # Panics
    ///
    /// If an evolution strategy has no pair, or a sigma that is not positive.
    pub fn estimate<B, P, R, O>(
        &self,
        problem: &BilevelProblem<B, P, R, O>,
        phi: &Tensor<B, 1>,
        seed: u64,
    ) -> MetaEstimate<B>
    where
        B: Backend,
        P: Objective<Autodiff<Autodiff<B>>>,
        R: Objective<Autodiff<B>>,
        O: Optimizer,
    {
        match *self {
            Self::Unrolled { clip } => unrolled(problem, phi, problem.inner.steps, clip),
            Self::Truncated { steps, clip } => unrolled(problem, phi, steps, clip),
            Self::Direct => unrolled(problem, phi, 0, None),
            Self::EvolutionStrategy { sigma, pairs } => {
                evolution(|phi| problem.loss(phi), phi, sigma, pairs, seed)
            }
            Self::AlternatingDescent { learning_rate } => {
                alternating_descent(problem, phi, learning_rate)
            }
        }
    }

    /// [`estimate`](MetaGradient::estimate) on the instance of `tasks` with this seed. An evolution
    /// strategy prepares the instance anew for every softness it evaluates.
    ///
    /// # Panics
    ///
    /// As [`MetaGradient::estimate`].
    pub fn estimate_on<B: Backend>(
        &self,
        tasks: &impl TaskDistribution<B>,
        seed: u64,
        phi: &Tensor<B, 1>,
    ) -> MetaEstimate<B> {
        match *self {
            Self::EvolutionStrategy { sigma, pairs } => {
                evolution(|phi| tasks.loss(seed, phi), phi, sigma, pairs, seed)
            }
            _ => self.estimate(&tasks.problem(seed, phi), phi, seed),
        }
    }
}
