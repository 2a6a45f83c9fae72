use std::sync::Arc;

use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_method::{FINER, Judge, LEARNING_TOLERANCE, LearnedEdge, Lesson, PreparedRun, Step};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer};
use softrast_runner::{Figure, Plan};

use crate::{Instance, Scene, Shape2d};

/// 2D SHAPE as something to learn a softness on.
pub struct Shape2dLesson {
    task: Shape2d,
    edge: LearnedEdge,
    faces: Arc<[[u32; 3]]>,
    judge: Judge,
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
        let edge = LearnedEdge::new(&solver.method, plan, solver.steps, solver.size);
        let faces = (0..task.triangles as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let judge = Judge::new::<HostBackend>(&faces, solver.size);
        let finer = task.source.image(FINER * solver.size)?;
        Ok(Self { task, edge, faces, judge, finer })
    }
}

impl Lesson for Shape2dLesson {
    type Scene<B: RasterBackend> = Scene<B>;
    type Drawing = PreparedRun;

    fn start(&self) -> Vec<f64> {
        self.edge.start()
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

    fn prepare(&self, phi: &[f64]) -> PreparedRun {
        let size = self.task.solver.size;
        let rasterizer = Rasterizer { tolerance: LEARNING_TOLERANCE, ..Rasterizer::new(size) };
        self.edge.prepare::<HostBackend>(rasterizer, &self.faces, phi)
    }

    fn prepared<B: RasterBackend>(
        &self,
        drawing: &PreparedRun,
        phi: Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1> {
        drawing.prepared(&self.edge, &phi, step)
    }

    fn stage(&self, step: usize) -> usize {
        self.edge.stage(step)
    }

    fn loss<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        drawing: &PreparedRun,
        theta: Tensor<B, 1>,
        phi: Tensor<B, 1>,
        step: Step,
    ) -> Tensor<B, 1> {
        let vertices = scene.vertices(theta.clone());
        let image = drawing.image(&self.edge, vertices, &phi, step);
        scene.image_loss(image) + scene.smoothness_loss(theta)
    }

    /// How well the image fits, without what keeps the scene smooth.
    fn judge<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.image_loss(self.judge.image(scene.vertices(theta)))
    }

    fn files(&self, phi: &[f64], note: &str) -> anyhow::Result<Vec<(&'static str, String)>> {
        self.edge.files(phi, note)
    }

    fn figures(&self, phi: &[f64]) -> Vec<Figure> {
        self.edge.figures::<HostBackend>(phi)
    }
}
