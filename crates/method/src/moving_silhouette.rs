use std::sync::Arc;

use burn::tensor::{DType, Tensor, TensorData, backend::Backend};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer, Silhouette};
use softrast_softness::{EdgeSoftness, Surrogate};

use crate::{Method, numbers, tensor};

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
    /// What the gradient is taken of, where that is not the image.
    felt: Option<Felt<B>>,
}

/// Silhouettes whose gradient stands for that of others, and their table; they do not move.
#[derive(Clone, Debug)]
struct Felt<B: Backend> {
    silhouette: Silhouette<EdgeSoftness>,
    table: Tensor<B, 2>,
}

impl<B: RasterBackend> MovingSilhouette<B> {
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
        let phi = method.phi(scale);
        let silhouette = rasterizer.prepare(faces, method.softness(), &on_host::<B>(&phi));
        let felt = method.surrogate().map(|Surrogate { softness, phi }| {
            let silhouette = rasterizer.prepare(faces, *softness, &on_host::<B>(phi));
            Felt { table: table(&silhouette, phi.clone()), silhouette }
        });
        let table = table(&silhouette, phi);
        let (method, faces) = (method.clone(), faces.clone());
        Self { method, rasterizer, faces, silhouette, prepared: scale, table, scale, felt }
    }

    /// Makes the next images at `scale`, with as little work as that takes.
    pub fn turn_to(&mut self, scale: f64) {
        if self.scale == scale {
            return;
        }
        let phi = self.method.phi(scale);
        if !(STALE..=1.0).contains(&(scale / self.prepared)) {
            let softness = self.method.softness();
            self.silhouette = self.rasterizer.prepare(&self.faces, softness, &on_host::<B>(&phi));
            self.prepared = scale;
        }
        (self.table, self.scale) = (table(&self.silhouette, phi), scale);
    }

    /// Coverage `[views, size, size]` of `vertices` `[views, vertices, 3]` (x and y in NDC, depth).
    ///
    /// Where the method has a surrogate, the gradient is that of
    /// [`Silhouette::coverage_with_surrogate`].
    pub fn image(&self, vertices: Tensor<B, 3>) -> Tensor<B, 3> {
        let table = self.table.clone();
        match &self.felt {
            None => self.silhouette.coverage_by_table(vertices, table),
            Some(felt) => self.silhouette.coverage_with_surrogate(
                vertices,
                table,
                &felt.silhouette,
                felt.table.clone(),
            ),
        }
    }
}

/// The table of parameters.
///
/// For a GPU it is computed on the CPU in f64: the GPU then gets it in one piece, instead of some
/// sixty small kernels over a few hundred numbers, and its curvature is not lost to rounding.
fn table<B: RasterBackend>(silhouette: &Silhouette<EdgeSoftness>, phi: Vec<f64>) -> Tensor<B, 2> {
    if B::ON_HOST {
        let shape = [phi.len()];
        return silhouette.table(tensor::<B, 1>(phi, shape));
    }
    let table = silhouette.table(on_host::<B>(&phi));
    let shape = table.dims();
    tensor(numbers(table), shape)
}

/// Parameters on the CPU; in f64 where they are not on the way to a CPU in f32 anyway.
fn on_host<B: RasterBackend>(phi: &[f64]) -> Tensor<HostBackend, 1> {
    let dtype = if B::ON_HOST { DType::F32 } else { DType::F64 };
    Tensor::from_data(TensorData::new(phi.to_vec(), [phi.len()]), (&Default::default(), dtype))
}
