//! Differentiable optimisers, inner loops, and learning through them, on burn.
//!
//! A scene is one flat vector θ, a softness one flat vector φ. An [`Objective`] gives the loss of both, an
//! [`InnerLoop`] solves for θ. A [`BilevelProblem`] adds an outer loss of the solution. [`MetaGradient`] is its
//! derivative with respect to φ, and an [`OuterLoop`] descends along it over the instances of a [`TaskDistribution`].
//! One inner loop serves learning and evaluation: on a plain backend it only solves, on `Autodiff<B>` its result
//! depends on φ. This crate does not render.
//!
//! ```
//! use softrast_tensor::{vector, Autodiff, Backend, NdArray, Tensor};
//! use softrast_meta::{InnerLoop, Objective, Sgd};
//!
//! /// A parabola around φ.
//! struct Parabola;
//! impl<B: Backend> Objective<B> for Parabola {
//!     fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
//!         (theta - phi).powi_scalar(2).sum()
//!     }
//! }
//!
//! type Outer = Autodiff<NdArray>;
//! let phi = vector::<Outer>(&[3.0]).require_grad();
//! let inner = InnerLoop { optimizer: Sgd { learning_rate: 0.25 }, steps: 4 };
//! let theta = inner.solve(&Parabola, vector::<Outer>(&[0.0]), &phi);
//! let by_phi = phi.grad(&theta.backward()).unwrap().into_scalar();
//! // Each step halves the distance to φ.
//! assert!((by_phi - (1.0 - 0.5_f32.powi(4))).abs() < 1e-6);
//! ```

mod adam;
mod adjoint;
mod alternating_descent;
mod bilevel_problem;
mod estimate;
mod evolution;
mod inner_loop;
mod meta_gradient;
mod objective;
mod optimizer;
mod outer_loop;
mod outer_steps;
mod progress;
mod ranks;
mod record;
mod sgd;
mod task_distribution;
mod unrolled;

pub use adam::{Adam, AdamState};
pub use bilevel_problem::BilevelProblem;
pub use estimate::MetaEstimate;
#[doc(hidden)]
pub use evolution::normal;
pub use inner_loop::{InnerLoop, descend};
pub use meta_gradient::MetaGradient;
pub use objective::Objective;
pub use optimizer::Optimizer;
pub use outer_loop::{LearnError, OuterLoop, Validation};
pub use outer_steps::OuterSteps;
pub use progress::{Best, Progress};
pub use ranks::{Alone, Ranks};
pub use record::Record;
pub use sgd::Sgd;
pub use task_distribution::TaskDistribution;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
