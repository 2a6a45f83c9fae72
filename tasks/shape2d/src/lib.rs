//! 2D SHAPE: moves loose triangles until they cover a picture.
//!
//! Hundreds of triangles lie in the image plane. Adam moves their corners, by the gradient of a
//! soft silhouette, until together they cover exactly the white pixels of a black-and-white
//! picture.
//!
//! **Definition.** The loss is the mean squared difference between soft silhouette and picture, plus the Laplacian of
//! each triangle, which keeps unused ones small; 200 steps at 256 × 256 pixels. θ holds the corners in NDC, see
//! [`Scene`]. Source: Wu et al. 2024, Sec. 5.1; docs/notes.md, 2D shape.
//!
//! **Errors.** Of the image: the mean squared error, soft and hard. Many arrangements of triangles
//! cover the same picture, so there are no right parameters and the paper has no error for them:
//! the hard mean squared error replaces it.
//!
//! **Seeds.** A seed places and turns the triangles before the first step.
//!
//! **Transfer.** 4,000 triangles instead of 800, and another picture; `--target` sets any other.
//!
//! **Colour.** With `--colour` triangles have colours and depths, and cover any picture in colour: [`colour`].

mod args;
pub mod colour;
mod letters;
mod logo;
mod paper;
mod target;
mod task;

pub use args::Args;
pub use logo::Logo;
pub use softrast_inverse::triangles::{Instance, Scene};
pub use task::Shape2d;

/// The whole program: `--colour` selects another task, with another θ, image and method.
pub fn main() -> std::process::ExitCode {
    softrast_cli::main_of_two::<Shape2d, colour::Coloured>(|args| args.colour)
}
