//! A problem of one number: its image is one pixel of that number, which should be 0.

use std::sync::Arc;

use softrast_inverse::{InverseProblem, SoftnessAt, SolveConfig};
use softrast_raster::RasterBackend;
use softrast_softness::Softness;
use softrast_tensor::Tensor;
use softrast_tests::vector;

/// `θ²` of numbers clamped to at least `floor`.
pub(super) struct Square {
    pub(super) floor: f64,
    /// Whether the image depends on θ.
    pub(super) seen: bool,
}

impl Square {
    /// The start that has an alternative, and the alternative.
    pub(super) const MANY: f64 = 4.0;
    pub(super) const OTHER: f64 = 6.0;
}

impl InverseProblem for Square {
    /// The initial number.
    type Instance = f64;
    type Scene<B: RasterBackend> = Vec<f64>;

    fn instance(&self, seed: u64) -> anyhow::Result<f64> {
        Ok(seed as f64)
    }

    fn restart(&self, instance: &f64, k: usize, _count: usize) -> Option<f64> {
        (*instance == Self::MANY && k == 1).then_some(Self::OTHER)
    }

    fn scene<B: RasterBackend>(&self, instances: &[f64], _size: usize) -> Vec<f64> {
        instances.to_vec()
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        None
    }

    fn start<B: RasterBackend>(&self, scene: &Vec<f64>) -> Tensor<B, 1> {
        vector(scene)
    }

    fn allowed<B: RasterBackend>(&self, _scene: &Vec<f64>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        theta.clamp_min(self.floor)
    }

    fn image<B: RasterBackend>(
        &self,
        _scene: &Vec<f64>,
        theta: Tensor<B, 1>,
        _softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        let theta = if self.seen { theta } else { theta.detach() };
        let [count] = theta.dims();
        theta.reshape([count, 1, 1, 1])
    }

    fn hard_image<B: RasterBackend>(&self, _scene: &Vec<f64>, theta: Tensor<B, 1>) -> Tensor<B, 4> {
        let [count] = theta.dims();
        theta.round().reshape([count, 1, 1, 1])
    }

    fn image_loss<B: RasterBackend>(&self, _scene: &Vec<f64>, image: Tensor<B, 4>) -> Tensor<B, 1> {
        (image.clone() * image).flatten(0, 3)
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 1, steps: 3, learning_rate: 0.25 }
    }
}
