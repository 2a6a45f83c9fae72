use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_method::{LearnedSilhouette, SilhouetteLesson, finer};
use softrast_raster::RasterBackend;
use softrast_runner::Plan;

use crate::{Instance, Scene, Shape2d};

/// 2D SHAPE as something to learn a softness on.
pub struct Shape2dLesson {
    task: Shape2d,
    drawn: LearnedSilhouette,
    /// The picture to cover on the finer image that judges.
    finer: Vec<f64>,
}

impl Shape2dLesson {
    /// Learns on `task` as `plan` says.
    ///
    /// # Errors
    ///
    /// If the picture to cover cannot be read.
    pub fn new(task: Shape2d, plan: &Plan) -> anyhow::Result<Self> {
        let solver = &task.solver;
        let faces = (0..task.triangles as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let drawn = LearnedSilhouette::new(&solver.method, plan, solver.steps, solver.size, faces);
        let finer = task.source.image(finer(plan) * solver.size)?;
        Ok(Self { task, drawn, finer })
    }
}

impl SilhouetteLesson for Shape2dLesson {
    type Scene<B: RasterBackend> = Scene<B>;

    fn drawn(&self) -> &LearnedSilhouette {
        &self.drawn
    }

    fn inner(&self) -> InnerLoop<Adam> {
        let solver = &self.task.solver;
        InnerLoop { optimizer: Adam::new(solver.learning_rate), steps: solver.steps }
    }

    fn scene<B: RasterBackend>(&self, seed: u64, finer: usize) -> anyhow::Result<Scene<B>> {
        let Shape2d { target, triangles, solver, .. } = &self.task;
        let target = if finer == 1 { target } else { &self.finer };
        Ok(Scene::new(target, &Instance::seeded(seed, *triangles), finer * solver.size))
    }

    fn theta<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start()
    }

    fn vertices<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 3> {
        scene.vertices(theta)
    }

    fn image_loss<B: RasterBackend>(&self, scene: &Scene<B>, image: Tensor<B, 3>) -> Tensor<B, 1> {
        scene.image_loss(image)
    }

    fn smoothness_loss<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        Some(scene.smoothness_loss(theta))
    }
}
