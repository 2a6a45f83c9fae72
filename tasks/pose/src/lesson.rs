use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_method::{Judge, LEARNING_TOLERANCE, LearnedEdge, Lesson, PreparedRun, Step};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer, iou_loss};
use softrast_runner::{Figure, Plan};

use crate::{Pose, Scene};

/// POSE as something to learn a softness on: every instance is one view.
pub struct PoseLesson {
    pose: Pose,
    edge: LearnedEdge,
    judge: Judge,
}

impl PoseLesson {
    /// Learns on `pose` as `plan` says.
    pub fn new(pose: Pose, plan: &Plan) -> Self {
        let solver = &pose.solver;
        let edge = LearnedEdge::new(&solver.method, plan, solver.steps, solver.size);
        let judge = Judge::new::<HostBackend>(&pose.mesh.faces().into(), solver.size);
        Self { pose, edge, judge }
    }
}

impl Lesson for PoseLesson {
    type Scene<B: RasterBackend> = Scene<B>;
    type Drawing = PreparedRun;

    fn start(&self) -> Vec<f64> {
        self.edge.start()
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

    fn prepare(&self, phi: &[f64]) -> PreparedRun {
        let Pose { mesh, solver, .. } = &self.pose;
        let rasterizer =
            Rasterizer { tolerance: LEARNING_TOLERANCE, ..Rasterizer::new(solver.size) };
        self.edge.prepare::<HostBackend>(rasterizer, &mesh.faces().into(), phi)
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
        let projected = scene.project(theta.unsqueeze());
        iou_loss(drawing.image(&self.edge, projected, &phi, step), scene.target())
    }

    fn judge<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        iou_loss(self.judge.image(scene.project(theta.unsqueeze())), scene.target())
    }

    fn files(&self, phi: &[f64], note: &str) -> anyhow::Result<Vec<(&'static str, String)>> {
        self.edge.files(phi, note)
    }

    fn figures(&self, phi: &[f64]) -> Vec<Figure> {
        self.edge.figures::<HostBackend>(phi)
    }
}
