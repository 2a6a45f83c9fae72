use std::sync::Arc;

use burn::tensor::Tensor;
use softrast_raster::{RasterBackend, Rasterizer, Silhouette};
use softrast_softness::{Family, Logistic};

use crate::tensor;

/// Scale of the softness that judges, in pixels of the image that judges: the least one whose gradient
/// does not depend on where between the pixels an edge lies. Source: META 6.6.
const JUDGE_PX: f64 = 0.25;

/// Silhouettes under a fixed narrow logistic: what results are judged by.
///
/// Source: META finding 9: judged by a softness that is being learned, wide ones flatter themselves.
#[derive(Clone, Debug)]
pub struct Judge {
    silhouette: Silhouette<Logistic>,
    phi: Vec<f64>,
}

impl Judge {
    /// A judge of meshes with these faces on images of `size` × `size` pixels.
    ///
    /// # Panics
    ///
    /// If there are no faces.
    pub fn new<B: RasterBackend>(faces: &Arc<[[u32; 3]]>, size: usize) -> Self {
        let phi = Family::Logistic.default_phi(JUDGE_PX * 2.0 / size as f64);
        let prepared = tensor::<B, 1>(phi.clone(), [phi.len()]);
        let silhouette = Rasterizer::new(size).prepare(faces, Logistic, &prepared);
        Self { silhouette, phi }
    }

    /// Coverage `[views, size, size]` of `vertices` `[views, vertices, 3]`.
    pub fn image<B: RasterBackend>(&self, vertices: Tensor<B, 3>) -> Tensor<B, 3> {
        self.silhouette.coverage(vertices, tensor(self.phi.clone(), [self.phi.len()]))
    }
}
