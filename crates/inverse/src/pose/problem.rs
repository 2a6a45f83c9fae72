use std::sync::Arc;

use softrast_raster::RasterBackend;
use softrast_softness::Softness;
use softrast_tensor::Tensor;

use super::{PoseInstance, PoseProblem, PoseScene};
use crate::{InverseProblem, SoftnessAt, SolveConfig};

impl InverseProblem for PoseProblem {
    type Instance = PoseInstance;
    type Scene<B: RasterBackend> = PoseScene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<PoseInstance> {
        let mut instance = PoseInstance::seeded(seed, self.range_deg);
        if !self.optimise_fov {
            instance.start.fov_deg = instance.target.fov_deg;
        }
        Ok(instance)
    }

    fn restart(&self, instance: &PoseInstance, k: usize, count: usize) -> Option<PoseInstance> {
        Some(instance.around(k, count))
    }

    fn scene<B: RasterBackend>(&self, instances: &[PoseInstance], size: usize) -> PoseScene<B> {
        PoseScene::new(self, instances, size)
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        Some(self.mesh.faces().into())
    }

    fn start<B: RasterBackend>(&self, scene: &PoseScene<B>) -> Tensor<B, 1> {
        scene.start().flatten(0, 1)
    }

    fn allowed<B: RasterBackend>(&self, scene: &PoseScene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.allowed(scene.by_view(theta)).flatten(0, 1)
    }

    fn image<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        softness.silhouette(scene.project(scene.by_view(theta))).unsqueeze_dim(1)
    }

    fn hard_image<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 4> {
        scene.hard(scene.project(scene.by_view(theta))).unsqueeze_dim(1)
    }

    fn image_loss<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        image: Tensor<B, 4>,
    ) -> Tensor<B, 1> {
        scene.image_loss(image.squeeze_dim(1))
    }

    fn loss_at<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        softness.iou_loss(scene.project(scene.by_view(theta)), scene.targets())
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 64, steps: 300, learning_rate: 0.3 }
    }
}
