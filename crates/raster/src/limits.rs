//! Depth and coordinate limits of drawing.

/// Camera depth, in world units, below which a vertex counts as behind the camera. Faces with such
/// a vertex are not drawn.
pub const NEAR: f64 = 1e-2;

/// Coordinates beyond this distance from the origin along an axis, in world units, are clamped to it: their squares would leave the range
/// of f32, and their gradients too.
pub(crate) const FARTHEST: f64 = 1e15;
