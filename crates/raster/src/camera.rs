use burn::tensor::{Tensor, backend::Backend};

/// Camera depth, in world units, below which a vertex counts as behind the camera. Faces with such
/// a vertex are not drawn.
pub const NEAR: f64 = 1e-2;

/// Vertices farther than this from the origin along an axis, in world units, are moved there: their
/// squares would leave the range of f32, and their gradients with them.
const FARTHEST: f64 = 1e15;

/// Rotation from world to camera axes for cameras that look at the origin with y up.
///
/// `elevation` and `azimuth` are `[views]` in degrees; the result is `[views, 3, 3]` with rows x
/// (right), y (up) and z (ahead). Both angles 0 give the identity: the camera stands at -z and looks
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

/// Perspective projection by cameras that orbit the origin.
///
/// `vertices` `[views, vertices, 3]` (or `[1, vertices, 3]` for all views) are world coordinates.
/// `orbits` `[views, 4]` holds for each view the distance in world units, then elevation, azimuth
/// and **half** the field of view in degrees. The result is `[views, vertices, 3]`: x and y in NDC
/// (the image is [-1, 1]², x right, y up) and the camera depth in world units.
///
/// Coordinates beyond 1e15 count as 1e15, so that nothing overflows and gradients stay finite. A
/// vertex nearer than [`NEAR`] is projected as though it were that near, so that nothing divides
/// by zero; the rasterizer does not draw its faces, by their depth.
///
/// Source: docs/notes.md, Camera.
///
/// # Panics
///
/// If the shapes do not fit.
pub fn project<B: Backend>(vertices: Tensor<B, 3>, orbits: Tensor<B, 2>) -> Tensor<B, 3> {
    let [views, four] = orbits.dims();
    assert_eq!(four, 4, "orbits must be [views, 4], found {:?}", orbits.dims());
    let [held, _, three] = vertices.dims();
    assert!(three == 3 && (held == views || held == 1), "vertices {:?}", vertices.dims());
    let column = |k: usize| orbits.clone().narrow(1, k, 1).reshape([views]);
    let rotation = view_rotation(column(1), column(2));
    let [distance, half_angle] = [column(0), column(3)].map(|c| c.reshape([views, 1, 1]));
    let [sin, cos] = sin_cos(half_angle);
    let focal = cos / sin;
    let zoom = Tensor::cat(vec![focal.clone(), focal.clone(), focal.ones_like()], 1);
    // One row for each axis: every op then runs along all vertices. The rasterizer wants the rows
    // too, and turning them back is free.
    let vertices = vertices.clamp(-FARTHEST, FARTHEST).swap_dims(1, 2);
    let camera = (rotation * zoom).matmul(vertices);
    let depth = camera.clone().narrow(1, 2, 1) + distance;
    let xy = camera.narrow(1, 0, 2) * depth.clone().clamp_min(NEAR).recip();
    Tensor::cat(vec![xy, depth], 1).swap_dims(1, 2)
}

fn sin_cos<B: Backend, const D: usize>(degrees: Tensor<B, D>) -> [Tensor<B, D>; 2] {
    // One factor: burn 0.21 differentiates a division by a number in f32.
    let radians = degrees * (std::f64::consts::PI / 180.0);
    [radians.clone().sin(), radians.cos()]
}
