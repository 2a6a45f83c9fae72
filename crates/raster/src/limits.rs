//! How near and how far is drawn.

/// Camera depth, in world units, below which a vertex counts as behind the camera. Faces with such
/// a vertex are not drawn.
pub const NEAR: f64 = 1e-2;

/// Vertices farther than this from the origin along an axis, in world units, are moved there: their
/// squares would leave the range of f32, and their gradients with them.
pub(crate) const FARTHEST: f64 = 1e15;
