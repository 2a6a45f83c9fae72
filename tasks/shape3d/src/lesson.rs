use std::sync::Arc;

use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_method::{Judge, LEARNING_TOLERANCE, LearnedEdge, Lesson, PreparedRun, Step};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer};
use softrast_runner::{Figure, Plan};

use crate::{Instance, Scene, Shape3d};

/// 3D SHAPE as something to learn a softness on.
pub struct Shape3dLesson {
    task: Shape3d,
    edge: LearnedEdge,
    faces: Arc<[[u32; 3]]>,
    judge: Judge,
}

impl Shape3dLesson {
    /// Learns on `task` as `plan` says.
    pub fn new(task: Shape3d, plan: &Plan) -> Self {
        let solver = &task.solver;
        let edge = LearnedEdge::new(&solver.method, plan, solver.steps, solver.size);
        let faces: Arc<[[u32; 3]]> = task.template.faces().into();
        let judge = Judge::new::<HostBackend>(&faces, solver.size);
        Self { task, edge, faces, judge }
    }
}

impl Lesson for Shape3dLesson {
    type Scene<B: RasterBackend> = Scene<B>;
    type Drawing = PreparedRun;

    fn start(&self) -> Vec<f64> {
        self.edge.start()
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
        let vertices = scene.vertices(theta);
        let image = drawing.image(&self.edge, scene.project(vertices.clone()), &phi, step);
        scene.image_loss(image) + scene.smoothness_loss(vertices)
    }

    /// How well the image fits, without what keeps the scene smooth.
    fn judge<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.image_loss(self.judge.image(scene.project(scene.vertices(theta))))
    }

    fn files(&self, phi: &[f64], note: &str) -> anyhow::Result<Vec<(&'static str, String)>> {
        self.edge.files(phi, note)
    }

    fn figures(&self, phi: &[f64]) -> Vec<Figure> {
        self.edge.figures::<HostBackend>(phi)
    }
}
