use serde::Serialize;
use softrast_tensor::{Autodiff, Backend, Tensor};

use crate::{
    BilevelProblem, MetaEstimate, Objective, Optimizer, TaskDistribution,
    alternating_descent::alternating_descent, evolution::evolution, unrolled::unrolled,
};

/// How the derivative of the outer loss by the softness is taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MetaGradient {
    /// Exact second order, through every inner step.
    Unrolled {
        /// Limit of the adjoint, as a multiple of what the outer loss put into it. Without it the
        /// gradient is exact, and beyond some ten steps of Adam often useless
        /// (docs/notes.md, Meta-gradients: chaos).
        clip: Option<f64>,
    },
    /// The same through the last steps only.
    Truncated {
        /// How many; with 0 it is [`Direct`](MetaGradient::Direct).
        steps: usize,
        /// As for [`Unrolled`](MetaGradient::Unrolled).
        clip: Option<f64>,
    },
    /// The derivative of the outer loss by φ where the inner loop ends, as though the solution did not
    /// depend on φ: what the released shape code does. Zero for an outer loss that ignores φ.
    Direct,
    /// An antithetic evolution strategy: differences of whole inner loops, no derivatives. Follows
    /// the outer loss blurred by a normal distribution.
    EvolutionStrategy {
        /// Standard deviation of the steps away from φ, the same for every parameter.
        sigma: f64,
        /// Pairs of inner loops.
        pairs: usize,
    },
    /// No derivative of the outer loss at all: the softness goes along with the scene, down the inner
    /// loss, and stays where it ends. What the released pose code does. Its "gradient" is the way that
    /// φ went, turned round, and a learner takes all of it.
    AlternatingDescent {
        /// Rate of the Adam that moves φ, once per inner step.
        learning_rate: f64,
    },
}

impl Default for MetaGradient {
    /// Through every step, with the adjoint kept within what the outer loss put into it.
    ///
    /// Source: docs/notes.md, Meta-gradients: clipping. How often its sign is right on the tasks
    /// stands in docs/studies/estimators.md.
    fn default() -> Self {
        Self::Unrolled { clip: Some(1.0) }
    }
}

impl MetaGradient {
    /// The outer loss of `problem` under `phi` `[P]` and its derivative.
    ///
    /// `seed` is that of the noise of an [evolution strategy](MetaGradient::EvolutionStrategy); all else has none. Memory holds one
    /// inner step's tape, and the scene and the optimiser's state before each step walked back.
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

    /// The same on the instance of `tasks` with this seed, which an evolution strategy prepares anew for every softness that it tries.
    ///
    /// # Panics
    ///
    /// Those of [`MetaGradient::estimate`].
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
