//! OCCLUSION: finds which of several overlapping quads is in front.
//!
//! Quads keep their place in the image; what moves is how far each is from the camera. Their
//! depths start at random, and Adam moves them by the gradient of a soft image, until each quad
//! hides those that it hides in the target.
//!
//! **Definition.** A pixel's colour is a mean of the textures, each weighted by how much its quad
//! covers the pixel and by how near it is (Eq. 4): `C = Σ a(dⱼ) b(zⱼ) cⱼ / Σ a(dⱼ) b(zⱼ)`, with the
//! signed distance d to the quad and its depth z. The background counts as a quad as far away as
//! quads may go that covers every pixel by [`BACKGROUND`]. The loss of an instance is the mean squared error
//! against the hard image of the target; instances in a batch are independent. Source: Wu et al.
//! 2024, Eq. 3 and 4, Sec. 5.1; docs/notes.md, Occlusion.
//!
//! **Not in the paper**, which gives the number of quads and the range of their depths alone: places,
//! textures, steps and learning rate are ours, see [`Instance::seeded`] and [`Problem`]. The view has
//! no perspective, so quads do not grow as they come nearer. Only the order of depths is visible
//! then, and only it is asked for.
//!
//! **Method.** One run from one start. The edge softness is that of the common flags; the depth has
//! one of its own, by default of the same family. It sees depths from the near plane on, see
//! [`DepthSoftness`](softrast_softness::DepthSoftness).
//!
//! **Transfer.** Eight quads, ten steps; only the front quad is asked for.

mod args;
mod depth;
mod error;
mod instance;
mod paper;
mod problem;
mod quad;
mod scene;
mod task;
mod texture;

pub use args::Args;
pub use error::DepthError;
pub use instance::Instance;
pub use problem::Problem;
pub use quad::Quad;
pub use scene::{BACKGROUND, Scene};
pub use task::Occlusion;
pub use texture::{Pattern, Texture};

/// The whole program.
pub fn main() -> std::process::ExitCode {
    softrast_cli::main::<Occlusion>()
}
