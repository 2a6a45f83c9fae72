use burn::{
    Tensor,
    tensor::{Device, TensorData},
};
use softrast::{
    raster::{self, Pinhole, Pinholes, RasterBackend},
    tensor::Tensor as Inner,
};

use crate::{
    extension::{of_one, of_two},
    op::Function,
};

/// Makes a tensor `[1, points, 3]` of points in world units: the vertices of a mesh, in the float type of the device.
pub fn vertex_tensor(positions: &[[f64; 3]], device: &Device) -> Tensor<3> {
    Tensor::from_data(TensorData::new(positions.concat(), [1, positions.len(), 3]), device)
}

/// Projects `vertices` `[views, vertices, 3]`, or `[1, vertices, 3]` for all views, from the world by these cameras,
/// one per view: `[views, vertices, 3]`, x and y in NDC and the depth. The vertices receive gradients.
///
/// # Panics
///
/// If the shapes do not fit, there is no camera, or their images differ in size.
pub fn project(vertices: Tensor<3>, cameras: &[Pinhole]) -> Tensor<3> {
    of_one(Seen(cameras.to_vec()), vertices)
}

/// Projects `vertices` by `orbits` `[views, 4]`: the distance in world units, then elevation,
/// azimuth and the full field of view in degrees.
/// Vertices and orbits receive gradients.
///
/// # Panics
///
/// If the shapes do not fit.
pub fn project_orbits(vertices: Tensor<3>, orbits: Tensor<2>) -> Tensor<3> {
    of_two(SeenFromOrbits, [vertices, orbits.unsqueeze_dim(0)])
}

#[derive(Debug)]
struct Seen(Vec<Pinhole>);

impl Function<3> for Seen {
    const MOVING: usize = 1;

    fn value<B: RasterBackend>(&self, inputs: Vec<Inner<B, 3>>) -> Inner<B, 3> {
        let [vertices] = inputs.try_into().expect("constant cameras see one input");
        let cameras = Pinholes::new(&self.0, &vertices.device());
        raster::project(vertices, cameras).tensor()
    }
}

#[derive(Debug)]
struct SeenFromOrbits;

impl Function<3> for SeenFromOrbits {
    const MOVING: usize = 2;

    fn value<B: RasterBackend>(&self, inputs: Vec<Inner<B, 3>>) -> Inner<B, 3> {
        let [vertices, orbits] = inputs.try_into().expect("orbits see vertices from cameras");
        raster::project(vertices, orbits.squeeze_dim::<2>(0)).tensor()
    }
}
