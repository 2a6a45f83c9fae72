//! What all tasks share: a softness, how its scale moves over the steps, and drawing with it.
//!
//! A [`Method`] is what the command line names: a softness family or file with a path of scales. A
//! [`MovingSilhouette`] draws with it, and prepares support and knots anew only when the scale has
//! moved so far that it must.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu")))]
compile_error!("softrast-method needs a backend: turn on one of the features ndarray, flex, wgpu");

mod method;
mod moving_silhouette;
mod tensor;

pub use method::{Defaults, Method};
pub use moving_silhouette::MovingSilhouette;
pub use tensor::{numbers, tensor};
