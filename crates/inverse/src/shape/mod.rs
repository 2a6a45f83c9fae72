//! The shape of a mesh from what cameras see of it: masks, normals and colours, each if there are some.

mod fit;
mod hull;
mod pixels;
mod stage;
mod target;
mod view;

pub use fit::{FoundShape, ShapeFit};
pub use hull::fitting_hull;
pub use view::ViewOfShape;
