//! The shape of a mesh fitted to masks and, if present, normals and colours.

mod fit;
mod hull;
mod pixels;
mod stage;
mod target;
mod view;

pub use fit::{FoundShape, ShapeFit};
pub use hull::fitting_hull;
pub use view::ViewOfShape;
