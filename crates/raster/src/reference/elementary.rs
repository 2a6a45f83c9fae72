//! Cameras and losses in tensor ops, the reference for tests of the small ops.

use softrast_kernel::EMPTY;
use softrast_tensor::{Backend, Tensor};

use crate::{
    NEAR, RasterBackend,
    limits::FARTHEST,
    small_product,
    view::{focal, view_rotation},
};

/// The matrices `[views, 3, 4]` of orbits `[views, 4]` (distance, elevation, azimuth, whole field of view in degrees): two rows give x and
/// y times the depth, the third gives the depth; see [`project`](crate::project).
pub fn orbit_matrices<B: RasterBackend>(orbits: Tensor<B, 2>) -> Tensor<B, 3> {
    let [views, _] = orbits.dims();
    let column = |k: usize| orbits.clone().narrow(1, k, 1).reshape([views]);
    let focal = focal(column(3));
    // The rotation has x left, the image x right.
    let zoom = Tensor::cat(vec![focal.clone().neg(), focal.clone(), focal.ones_like()], 1);
    let rotation = view_rotation(column(1), column(2)) * zoom;
    let distance = column(0).reshape([views, 1, 1]);
    let beside = distance.clone() * 0.0;
    let shift = Tensor::cat(vec![beside.clone(), beside, distance], 1);
    Tensor::cat(vec![rotation, shift], 2)
}

/// Projects `vertices` `[views or 1, vertices, 3]` by these matrices: x and y in NDC and depth, `[views, vertices, 3]`.
pub fn perspective<B: RasterBackend>(
    vertices: Tensor<B, 3>,
    matrices: Tensor<B, 3>,
) -> Tensor<B, 3> {
    let vertices = vertices.clamp(-FARTHEST, FARTHEST).swap_dims(1, 2);
    let seen = small_product(matrices.clone().narrow(2, 0, 3), vertices) + matrices.narrow(2, 3, 1);
    let depth = seen.clone().narrow(1, 2, 1);
    let xy = seen.narrow(1, 0, 2) * depth.clone().clamp_min(NEAR).recip();
    Tensor::cat(vec![xy, depth], 1).swap_dims(1, 2)
}

/// [`iou_loss`](crate::iou_loss).
pub fn iou_loss<B: Backend>(image: Tensor<B, 3>, target: Tensor<B, 3>) -> Tensor<B, 1> {
    let overlap = image.clone() * target.clone();
    let union = of_views(image + target - overlap.clone(), Tensor::sum_dim);
    (of_views(overlap, Tensor::sum_dim) / (union + EMPTY)).neg() + 1.0
}

/// [`mse_loss`](crate::mse_loss).
pub fn mse_loss<B: Backend, const D: usize>(
    image: Tensor<B, D>,
    target: Tensor<B, D>,
) -> Tensor<B, 1> {
    let difference = image - target;
    of_views(difference.clone() * difference, Tensor::mean_dim)
}

/// Reduces pixels `[views, ..]` to one number per view `[views]`.
fn of_views<B: Backend, const D: usize>(
    pixels: Tensor<B, D>,
    of: impl Fn(Tensor<B, 2>, usize) -> Tensor<B, 2>,
) -> Tensor<B, 1> {
    let views = pixels.dims()[0];
    of(pixels.flatten(1, D - 1), 1).reshape([views])
}
