//! Optimisers that can be differentiated, and inner loops for meta-learning on burn.
//!
//! A scene is one flat vector θ, a softness one flat vector φ. An [`Objective`] gives the loss of
//! both, an [`InnerLoop`] solves for θ. The same loop learns and evaluates: on a plain backend it
//! just solves, on `Autodiff<B>` its result still depends on φ. Nothing here knows of rendering.

mod adam;
mod inner_loop;
mod objective;
mod optimizer;
mod sgd;

pub use adam::{Adam, AdamState};
pub use inner_loop::{InnerLoop, gradient};
pub use objective::Objective;
pub use optimizer::Optimizer;
pub use sgd::Sgd;
