//! 2D SHAPE in colour: loose triangles, each with a colour and a depth, cover any picture.
//!
//! **Definition.** The loss is the mean squared difference of colours between the soft blend of all triangles and the picture. The score is
//! the PSNR of the hard image, which has the colour of the nearest triangle at each pixel: `-10 log₁₀` of its mean squared error. θ holds
//! corners, colours and depths, see [`Scene`]. Not in the paper: docs/notes.md, 2D shape in colour.

mod colours;
mod drawing;
mod scene;
mod start;
mod task;

pub use colours::Colours;
pub use drawing::landscape;
pub use scene::Scene;
pub use start::Start;
pub use task::Coloured;
