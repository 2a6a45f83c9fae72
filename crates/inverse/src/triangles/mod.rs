//! 2D SHAPE as a scene: loose triangles in the image plane, and their target picture.
//!
//! θ holds the corners in NDC, see [`Scene`]. Source: Wu et al. 2024, Sec. 5.1; docs/notes.md, 2D shape.

mod instance;
mod scene;

pub use instance::Instance;
pub use scene::Scene;
