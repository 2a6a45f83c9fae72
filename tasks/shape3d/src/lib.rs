//! 3D SHAPE: deforms a sphere until it has the silhouettes of a target.
//!
//! 24 cameras surround a target mesh, all at one elevation. Adam moves the vertices of a template,
//! by default a sphere of 642 vertices, by the gradient of soft silhouettes, until its silhouettes
//! match the target's.
//!
//! **Definition.** The loss is the soft `IoU` loss against the target's hard silhouettes, mean over
//! the views, plus 0.03 times the Laplacian and 0.0003 times the flatness of the surface. For the
//! vertices at θ see [`Scene`]. Source: Wu et al. 2024, Sec. 5.1; docs/notes.md, 3D shape.
//!
//! **Errors.** Of the image: the `IoU` loss, soft and hard. Of the shape: the [`Chamfer`] distance
//! to the target's surface. All cameras are at one elevation: surfaces that none of them sees count
//! in the Chamfer distance only.
//!
//! **Seeds.** Seeds 0 to 4 are the elevations 30, 60, 0, -30 and -60 degrees; further ones repeat
//! them with the template rotated at random, see [`Instance::seeded`].
//!
//! **Transfer.** A chair instead of an airplane; `--mesh` sets any other mesh.

mod args;
mod chamfer;
mod instance;
mod paper;
mod scene;
mod task;
mod views;

pub use args::Args;
pub use chamfer::Chamfer;
pub use instance::Instance;
pub use scene::{Scene, VIEWS};
pub use task::Shape3d;
pub use views::{Begin, Views};

/// The whole program.
pub fn main() -> std::process::ExitCode {
    softrast_cli::main::<Shape3d>()
}
