use std::sync::Arc;

use burn::tensor::{Tensor, backend::Backend};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette};
use softrast_softness::EdgeSoftness;

use crate::{Method, tensor};

/// A scale may fall by this factor before support and knots are chosen anew.
const STALE: f64 = 0.95;

/// Soft silhouettes of one mesh topology at a scale that moves.
#[derive(Clone, Debug)]
pub struct MovingSilhouette<B: Backend> {
    method: Method,
    rasterizer: Rasterizer,
    faces: Arc<[[u32; 3]]>,
    silhouette: Silhouette<EdgeSoftness>,
    /// The scale that support and knots of `silhouette` were chosen for.
    prepared: f64,
    table: Tensor<B, 2>,
    /// The scale of `table`.
    scale: f64,
}

impl<B: Backend> MovingSilhouette<B> {
    /// Silhouettes by `rasterizer` of meshes with these faces, at first at `scale` (as
    /// [`Method::scale`] gives it).
    ///
    /// # Panics
    ///
    /// If there are no faces.
    pub fn new(
        method: &Method,
        rasterizer: Rasterizer,
        faces: &Arc<[[u32; 3]]>,
        scale: f64,
    ) -> Self {
        let phi = phi::<B>(method, scale);
        let silhouette = rasterizer.prepare(faces, method.softness(), &phi);
        let table = moved(silhouette.table(phi));
        let (method, faces) = (method.clone(), faces.clone());
        Self { method, rasterizer, faces, silhouette, prepared: scale, table, scale }
    }

    /// Makes the next images at `scale`, with as little work as that takes.
    pub fn turn_to(&mut self, scale: f64) {
        if self.scale == scale {
            return;
        }
        let phi = phi::<B>(&self.method, scale);
        if !(STALE..=1.0).contains(&(scale / self.prepared)) {
            self.silhouette = self.rasterizer.prepare(&self.faces, self.method.softness(), &phi);
            self.prepared = scale;
        }
        (self.table, self.scale) = (moved(self.silhouette.table(phi)), scale);
    }
}

impl<B: RasterBackend> MovingSilhouette<B> {
    /// Coverage `[views, size, size]` of `vertices` `[views, vertices, 3]` (x and y in NDC, depth).
    pub fn image(&self, vertices: Tensor<B, 3>) -> Tensor<B, 3> {
        self.silhouette.coverage_by_table(vertices, self.table.clone())
    }
}

/// Parameters at a scale, where supports, knots and tables are computed: on the backend itself.
#[cfg(not(feature = "wgpu"))]
fn phi<B: Backend>(method: &Method, scale: f64) -> Tensor<B, 1> {
    let phi = method.phi(scale);
    let shape = [phi.len()];
    tensor(phi, shape)
}

#[cfg(not(feature = "wgpu"))]
fn moved<B: Backend>(table: Tensor<B, 2>) -> Tensor<B, 2> {
    table
}

/// Parameters at a scale, where supports, knots and tables are computed: on the CPU in f64. A GPU
/// then gets a table in one piece, instead of some sixty small kernels over a few hundred numbers,
/// and its curvature is not lost to rounding.
#[cfg(feature = "wgpu")]
fn phi<B: Backend>(method: &Method, scale: f64) -> Tensor<burn::backend::NdArray<f32>, 1> {
    let phi = method.phi(scale);
    let shape = [phi.len()];
    let data = burn::tensor::TensorData::new(phi, shape);
    Tensor::from_data(data, (&Default::default(), burn::tensor::DType::F64))
}

#[cfg(feature = "wgpu")]
fn moved<B: Backend>(table: Tensor<burn::backend::NdArray<f32>, 2>) -> Tensor<B, 2> {
    let shape = table.dims();
    tensor(crate::numbers(table), shape)
}
