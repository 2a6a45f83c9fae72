//! What all tasks share: a softness, how its scale moves over the steps, drawing with it, and the
//! steps themselves.
//!
//! A [`Method`] is what the command line names: a softness family or file with a path of scales. A
//! [`MovingSilhouette`] draws with it, and prepares support and knots anew only when the scale has
//! moved so far that it must. A [`Descent`] goes down the gradient of a task's loss and shows every
//! step.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu")))]
compile_error!("softrast-method needs a backend: turn on one of the features ndarray, flex, wgpu");

mod descent;
mod method;
mod moving_silhouette;
mod tensor;

pub use descent::{Descent, Moment};
pub use method::{Defaults, Method};
pub use moving_silhouette::MovingSilhouette;
pub use tensor::{numbers, tensor};
