//! OCCLUSION: finds which of several overlapping quads is in front.
//!
//! The positions of quads in the image are fixed; their depths are optimised. Depths start at
//! random, and Adam moves them by the gradient of a soft image, until each quad hides the same
//! quads as in the target.
//!
//! **Definition.** A pixel's colour is a mean of the textures, each weighted by the quad's coverage
//! of the pixel and by its nearness (Eq. 4): `C = Σ a(dⱼ) b(zⱼ) cⱼ / Σ a(dⱼ) b(zⱼ)`, with the
//! signed distance d to the quad and its depth z. The background is a quad at the largest allowed
//! depth that covers every pixel by [`BACKGROUND`]. The loss of an instance is the mean squared
//! error against the hard image of the target; instances in a batch are independent. Source: Wu et
//! al. 2024, Eq. 3 and 4, Sec. 5.1; docs/notes.md, Occlusion.
//!
//! **Not in the paper**, which gives only the number of quads and the range of their depths:
//! positions, textures, steps and learning rate are ours, see [`Instance::seeded`] and [`Problem`].
//! The view has no perspective, so the size of a quad does not depend on its depth. Therefore only
//! the order of depths is visible, and only the order is to be found.
//!
//! **Method.** One run from one start. The edge softness is that of the common flags; the depth has
//! a separate one, by default of the same family. Its input is the depth from the near plane on,
//! see [`DepthSoftness`](softrast_softness::DepthSoftness).
//!
//! **Transfer.** Eight quads, ten steps; only the front quad is to be found.

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
