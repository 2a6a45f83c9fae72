use std::sync::Arc;

use burn::tensor::Tensor;
use softrast_raster::{HostBackend, RasterBackend, Rasterizer, Silhouette, hard_silhouette};
use softrast_runner::{Plan, Referee};
use softrast_softness::{Family, Softness, families::Logistic};

use crate::{finer, tensor};

/// Scale of the softness that judges, in pixels of the image that judges: the least one whose gradient
/// does not depend on where between the pixels an edge lies. Source: META 6.6.
const JUDGE_PX: f64 = 0.25;
/// The same for [`Referee::Pixels`], nearly hard: at a quarter of a pixel, edges that run through the middle of
/// pixels cost half of what they cost the hard image.
const NEARLY_HARD_PX: f64 = 0.05;

/// Silhouettes by which results are judged: hard, or under a fixed narrow logistic.
///
/// Source: META finding 9: judged by a softness that is being learned, wide ones flatter themselves.
#[derive(Clone, Debug)]
pub struct Judge {
    faces: Arc<[[u32; 3]]>,
    size: usize,
    soft: Option<(Silhouette<Logistic>, Vec<f64>)>,
}

impl Judge {
    /// The judge that `plan` asks for, of meshes with these faces whose images have `size` × `size` pixels where
    /// they are optimised.
    ///
    /// # Panics
    ///
    /// If there are no faces.
    pub fn new(plan: &Plan, faces: &Arc<[[u32; 3]]>, size: usize) -> Self {
        let size = finer(plan) * size;
        let soft = (plan.referee != Referee::Hard).then(|| {
            let pixels = match plan.referee {
                Referee::Pixels => NEARLY_HARD_PX,
                Referee::Fixed | Referee::Hard | Referee::Own => JUDGE_PX,
            };
            let phi = Family::Logistic.default_phi(pixels * 2.0 / size as f64);
            let prepared = tensor::<HostBackend, 1>(phi.clone(), [phi.len()]);
            (Rasterizer::new(size).prepare(faces, Logistic, &prepared), phi)
        });
        Self { faces: faces.clone(), size, soft }
    }

    /// Coverage `[views, pixels, pixels]` of `vertices` `[views, vertices, 3]`.
    pub fn image<B: RasterBackend>(&self, vertices: Tensor<B, 3>) -> Tensor<B, 3> {
        match &self.soft {
            None => hard_silhouette(vertices, &self.faces, self.size),
            Some((silhouette, phi)) => {
                silhouette.coverage(vertices, tensor(phi.clone(), [phi.len()]))
            }
        }
    }
}
