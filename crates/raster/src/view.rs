//! The views of orbiting cameras: their rotations, and how near and how far is drawn.

use burn::tensor::{Tensor, backend::Backend};

/// Camera depth, in world units, below which a vertex counts as behind the camera. Faces with such
/// a vertex are not drawn.
pub const NEAR: f64 = 1e-2;

/// Vertices farther than this from the origin along an axis, in world units, are moved there: their
/// squares would leave the range of f32, and their gradients with them.
pub(crate) const FARTHEST: f64 = 1e15;

/// Rotation from world to camera axes for cameras that look at the origin with y up.
///
/// `elevation` and `azimuth` are `[views]` in degrees; the result is `[views, 3, 3]` with rows x
/// (left), y (up) and z (ahead), as PyTorch3D has them. Both angles 0 give the identity: the camera stands at -z and looks
/// along +z.
///
/// Past the pole (|elevation| > 90°) the view rolls by half a turn, as `look_at` does. At the pole
/// itself, where `look_at` divides by zero, this form keeps the axes that it has just before.
///
/// Source: docs/notes.md, Camera, with the cross products of `look_at` multiplied out.
pub fn view_rotation<B: Backend>(elevation: Tensor<B, 1>, azimuth: Tensor<B, 1>) -> Tensor<B, 3> {
    let [sin_e, cos_e] = sin_cos(elevation);
    let [sin_a, cos_a] = sin_cos(azimuth);
    // Which way is up: constant on either side of the pole, so it has no gradient.
    let sign = cos_e.clone().sign();
    let roll = sign.clone().mask_fill(sign.equal_elem(0.0), 1.0);
    let zero = cos_a.clone() * 0.0;
    let rows = vec![
        cos_a.clone() * roll.clone(),
        zero,
        sin_a.clone() * roll.clone(),
        (sin_e.clone() * sin_a.clone() * roll.clone()).neg(),
        cos_e.clone() * roll.clone(),
        sin_e.clone() * cos_a.clone() * roll,
        (cos_e.clone() * sin_a).neg(),
        sin_e.neg(),
        cos_e * cos_a,
    ];
    let views = rows[0].dims()[0];
    Tensor::stack::<2>(rows, 1).reshape([views, 3, 3])
}

/// Distance of the image plane in NDC, `[views, 1, 1]`.
pub(crate) fn focal<B: Backend>(fov_deg: Tensor<B, 1>) -> Tensor<B, 3> {
    let [views] = fov_deg.dims();
    let [sin, cos] = sin_cos(fov_deg * 0.5);
    (cos / sin).reshape([views, 1, 1])
}

fn sin_cos<B: Backend, const D: usize>(degrees: Tensor<B, D>) -> [Tensor<B, D>; 2] {
    // One factor: burn 0.21 differentiates a division by a number in f32.
    let radians = degrees * (std::f64::consts::PI / 180.0);
    [radians.clone().sin(), radians.cos()]
}
