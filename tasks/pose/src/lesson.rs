use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_method::{LearnedSilhouette, SilhouetteLesson};
use softrast_raster::RasterBackend;
use softrast_runner::Plan;

use crate::{Pose, Scene};

/// POSE as something to learn a softness on: every instance is one view.
pub struct PoseLesson {
    pose: Pose,
    drawn: LearnedSilhouette,
}

impl PoseLesson {
    /// Learns on `pose` as `plan` says.
    pub fn new(pose: Pose, plan: &Plan) -> Self {
        let (solver, faces) = (&pose.solver, pose.mesh.faces().into());
        let drawn = LearnedSilhouette::new(&solver.method, plan, solver.steps, solver.size, faces);
        Self { pose, drawn }
    }
}

impl SilhouetteLesson for PoseLesson {
    type Scene<B: RasterBackend> = Scene<B>;

    fn drawn(&self) -> &LearnedSilhouette {
        &self.drawn
    }

    fn inner(&self) -> InnerLoop<Adam> {
        let solver = &self.pose.solver;
        InnerLoop { optimizer: Adam::new(solver.learning_rate), steps: solver.steps }
    }

    fn scene<B: RasterBackend>(&self, seed: u64, finer: usize) -> anyhow::Result<Scene<B>> {
        let Pose { mesh, solver, optimise_fov, .. } = &self.pose;
        let instance = self.pose.instance(seed)?;
        Ok(Scene::new(mesh, &[instance], finer * solver.size, *optimise_fov))
    }

    fn theta<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start().flatten(0, 1)
    }

    fn allowed<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.allowed(theta.unsqueeze()).flatten(0, 1)
    }

    fn vertices<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 3> {
        scene.project(theta.unsqueeze())
    }

    fn image_loss<B: RasterBackend>(&self, scene: &Scene<B>, image: Tensor<B, 3>) -> Tensor<B, 1> {
        scene.image_loss(image)
    }
}
