//! Optimisers that can be differentiated, inner loops, and learning through them, on burn.
//!
//! A scene is one flat vector θ, a softness one flat vector φ. An [`Objective`] gives the loss of
//! both, an [`InnerLoop`] solves for θ. A [`Problem`] adds an outer loss of the solution, and
//! [`MetaGradient`] its derivative by φ, and a [`Learner`] goes down it over many [`Tasks`]. The same loop learns and evaluates: on a plain backend it
//! just solves, on `Autodiff<B>` its result still depends on φ. Nothing here knows of rendering.

mod adam;
mod adjoint;
mod checkpoint;
mod estimate;
mod evolution;
mod exact;
mod inner_loop;
mod joint_loop;
mod learner;
mod measured;
mod meta_gradient;
mod objective;
mod optimizer;
mod problem;
mod progress;
mod record;
mod sgd;
mod tasks;
mod unrolled;
mod vector;

pub use adam::{Adam, AdamState};
pub use checkpoint::{Checkpoint, CheckpointError};
pub use estimate::MetaEstimate;
pub use inner_loop::{InnerLoop, gradient};
pub use joint_loop::JointLoop;
pub use learner::{LearnError, Learner, Validation};
pub use measured::Measured;
pub use meta_gradient::MetaGradient;
pub use objective::Objective;
pub use optimizer::Optimizer;
pub use problem::Problem;
pub use progress::{Best, Progress};
pub use record::Record;
pub use sgd::Sgd;
pub use tasks::Tasks;
