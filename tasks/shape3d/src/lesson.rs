use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_method::{LearnedSilhouette, SilhouetteLesson};
use softrast_raster::RasterBackend;
use softrast_runner::Plan;

use crate::{Instance, Scene, Shape3d};

/// 3D SHAPE as something to learn a softness on.
pub struct Shape3dLesson {
    task: Shape3d,
    drawn: LearnedSilhouette,
}

impl Shape3dLesson {
    /// Learns on `task` as `plan` says.
    pub fn new(task: Shape3d, plan: &Plan) -> Self {
        let (solver, faces) = (&task.solver, task.template.faces().into());
        let drawn = LearnedSilhouette::new(&solver.method, plan, solver.steps, solver.size, faces);
        Self { task, drawn }
    }
}

impl SilhouetteLesson for Shape3dLesson {
    type Scene<B: RasterBackend> = Scene<B>;

    fn drawn(&self) -> &LearnedSilhouette {
        &self.drawn
    }

    fn inner(&self) -> InnerLoop<Adam> {
        let solver = &self.task.solver;
        InnerLoop { optimizer: solver.adam(), steps: solver.steps }
    }

    fn scene<B: RasterBackend>(&self, seed: u64, finer: usize) -> anyhow::Result<Scene<B>> {
        let Shape3d { target, template, elevation_deg, solver, .. } = &self.task;
        let instance = Instance::seeded(seed, *elevation_deg);
        Ok(Scene::new(target, template, &instance, finer * solver.size))
    }

    fn theta<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start()
    }

    fn vertices<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 3> {
        scene.project(scene.vertices(theta))
    }

    fn image_loss<B: RasterBackend>(&self, scene: &Scene<B>, image: Tensor<B, 3>) -> Tensor<B, 1> {
        scene.image_loss(image)
    }

    fn smoothness_loss<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        Some(scene.smoothness_loss(scene.vertices(theta)))
    }
}
