use burn::tensor::{Tensor, backend::Backend};
use softrast_softness::{numbers, tensor_on};

use crate::{
    RasterBackend,
    backend::{elementary, primitive},
    fused::ElementaryOp,
    reference,
};

/// Camera depth, in world units, below which a vertex counts as behind the camera. Faces with such
/// a vertex are not drawn.
pub const NEAR: f64 = 1e-2;

/// Vertices farther than this from the origin along an axis, in world units, are moved there: their
/// squares would leave the range of f32, and their gradients with them.
pub(crate) const FARTHEST: f64 = 1e15;

/// A line of sight, or an up across it, that is not longer than this has no direction, in world units.
const SHORTEST: f64 = 1e-12;

/// A camera that looks at the origin, with y up.
///
/// ```
/// # use burn::backend::NdArray;
/// use softrast_raster::Orbit;
///
/// let front = Orbit { distance: 3.0, elevation_deg: 0.0, azimuth_deg: 0.0, fov_deg: 40.0 };
/// let side = Orbit { azimuth_deg: 90.0, ..front };
/// let cameras = Orbit::tensors::<NdArray>(&[front, side], &Default::default()); // [2, 4]
/// assert_eq!(Orbit::from_tensor(cameras), [front, side]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Distance from the origin, in world units.
    pub distance: f64,
    /// Angle above the ground.
    pub elevation_deg: f64,
    /// Angle around the vertical axis: at 0 the camera stands at -z with +x on the left, at 90 at +x.
    pub azimuth_deg: f64,
    /// Whole field of view along the shorter side of the image; below 180.
    pub fov_deg: f64,
}

impl Orbit {
    /// The numbers as [`project`] takes them, `[1, 4]`.
    pub fn tensor<B: Backend>(&self, device: &B::Device) -> Tensor<B, 2> {
        Self::tensors(std::slice::from_ref(self), device)
    }

    /// The numbers of a camera for each view, `[views, 4]`.
    pub fn tensors<B: Backend>(cameras: &[Self], device: &B::Device) -> Tensor<B, 2> {
        tensor_on(
            cameras.iter().flat_map(|camera| camera.numbers()).collect(),
            [cameras.len(), 4],
            device,
        )
    }

    /// The cameras that such a tensor `[views, 4]` stands for.
    ///
    /// # Panics
    ///
    /// If the tensor has another shape.
    pub fn from_tensor<B: Backend>(cameras: Tensor<B, 2>) -> Vec<Self> {
        let [_, four] = cameras.dims();
        assert_eq!(four, 4, "orbits must be [views, 4], found {:?}", cameras.dims());
        let of = |c: &[f64]| Self {
            distance: c[0],
            elevation_deg: c[1],
            azimuth_deg: c[2],
            fov_deg: c[3],
        };
        numbers(cameras).chunks(4).map(of).collect()
    }

    fn numbers(&self) -> [f64; 4] {
        [self.distance, self.elevation_deg, self.azimuth_deg, self.fov_deg]
    }
}

/// Points in world units as a tensor `[1, points, 3]`, in the float type of the backend: the vertices of a mesh, for [`project`].
pub fn vertices<B: Backend>(positions: &[[f64; 3]], device: &B::Device) -> Tensor<B, 3> {
    tensor_on(positions.concat(), [1, positions.len(), 3], device)
}

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

/// Perspective projection by cameras that orbit the origin.
///
/// `vertices` `[views, vertices, 3]` (or `[1, vertices, 3]` for all views) are world coordinates.
/// `orbits` `[views, 4]` holds for each view the distance in world units, then elevation, azimuth
/// and the whole field of view in degrees, as [`Orbit::tensor`] makes it. The result is `[views,
/// vertices, 3]`: x and y in NDC (x right, y up; the shorter side of the image is [-1, 1]) and the camera depth in world
/// units.
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
pub fn project<B: RasterBackend>(vertices: Tensor<B, 3>, orbits: Tensor<B, 2>) -> Tensor<B, 3> {
    let [_, four] = orbits.dims();
    assert_eq!(four, 4, "orbits must be [views, 4], found {:?}", orbits.dims());
    let matrices = match B::ON_HOST {
        true => elementary(ElementaryOp::OrbitMatrix, vec![primitive(orbits)]),
        false => reference::orbit_matrices(orbits),
    };
    perspective(vertices, matrices)
}

/// What cameras with these matrices `[views, 3, 4]` see: two rows give x and y times the depth, the third gives the depth.
pub(crate) fn perspective<B: RasterBackend>(
    vertices: Tensor<B, 3>,
    matrices: Tensor<B, 3>,
) -> Tensor<B, 3> {
    let ([held, _, three], [views, ..]) = (vertices.dims(), matrices.dims());
    assert!(three == 3 && (held == views || held == 1), "vertices {:?}", vertices.dims());
    if !B::ON_HOST {
        return reference::perspective(vertices, matrices);
    }
    // The rasterizer wants one row for each axis, and turning them back is free.
    let inputs = vec![primitive(vertices), primitive(matrices)];
    elementary::<B, 3>(ElementaryOp::Perspective, inputs).swap_dims(1, 2)
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

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

/// `a / |a|`; `otherwise` is what is wrong where that is no direction.
pub(crate) fn unit(a: [f64; 3], otherwise: &str) -> [f64; 3] {
    let length = dot(a, a).sqrt();
    assert!(length > SHORTEST, "{otherwise}");
    a.map(|x| x / length)
}
