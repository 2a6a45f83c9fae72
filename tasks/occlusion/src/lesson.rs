use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_method::{LearnedEdge, Lesson, Step, numbers, tensor};
use softrast_raster::{HostBackend, RasterBackend};
use softrast_runner::{Curve, Figure, Plan, Referee};
use softrast_softness::{DepthSoftness, DepthSoftnessFile, EdgeSoftness, Family, Softness};

use crate::{Instance, Occlusion, Scene};

/// Scales of the softnesses that judge: edges in NDC, depths in units of the distance between the
/// planes. The second is a fifth of the default of the task: narrower than any that can be
/// optimised, and wide enough to have a gradient.
const JUDGE: [f64; 2] = [0.0005, 0.02];

/// OCCLUSION as something to learn two softnesses on: φ is that of the edges, then that of the depths.
pub struct OcclusionLesson {
    task: Occlusion,
    edge: LearnedEdge,
    /// Whether the hard image judges.
    hard: bool,
}

impl OcclusionLesson {
    /// Learns on `task` as `plan` says.
    pub fn new(task: Occlusion, plan: &Plan) -> Self {
        let solver = &task.solver;
        let edge = LearnedEdge::new(&solver.edge, plan, solver.steps, solver.size);
        Self { task, edge, hard: plan.referee == Referee::Hard }
    }

    /// The depth part of φ, `[P]`.
    fn depth<B: RasterBackend>(&self, phi: &Tensor<B, 1>) -> Tensor<B, 1> {
        let [all] = phi.dims();
        let edge = self.edge.parameters();
        phi.clone().narrow(0, edge, all - edge)
    }

    /// Logarithm of the weight of a depth over its nearness.
    fn weights(&self, phi: &[f64]) -> Vec<[f64; 2]> {
        const PLACES: usize = 100;
        let softness = self.task.solver.depth.softness;
        let phi = tensor::<HostBackend, 1>(phi.to_vec(), [phi.len()]);
        let places: Vec<f64> = (0..=PLACES).map(|k| k as f64 / PLACES as f64).collect();
        let weights = softness.log_weight(phi, tensor(places.clone(), [PLACES + 1]));
        places.into_iter().zip(numbers(weights)).map(|(near, weight)| [near, weight]).collect()
    }
}

impl Lesson for OcclusionLesson {
    type Scene<B: RasterBackend> = Scene<B>;
    type Drawing = ();

    fn start(&self) -> Vec<f64> {
        let mut phi = self.edge.start();
        phi.extend(&self.task.solver.depth.phi);
        phi
    }

    fn inner(&self) -> InnerLoop<Adam> {
        let solver = &self.task.solver;
        InnerLoop { optimizer: Adam::new(solver.learning_rate), steps: solver.steps }
    }

    fn scene<B: RasterBackend>(&self, seed: u64, finer: usize) -> anyhow::Result<Scene<B>> {
        let Occlusion { problem, solver, .. } = &self.task;
        Ok(Scene::new(problem, &[Instance::seeded(seed, problem)], finer * solver.size))
    }

    fn theta<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start().flatten(0, 1)
    }

    fn allowed<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.allowed(theta.unsqueeze()).flatten(0, 1)
    }

    fn prepare(&self, _phi: &[f64]) {}

    fn loss<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        (): &(),
        theta: Tensor<B, 1>,
        phi: Tensor<B, 1>,
        step: Step,
    ) -> Tensor<B, 1> {
        let own = phi.clone().narrow(0, 0, self.edge.parameters());
        let edges = scene.edges(self.edge.softness(), self.edge.phi(&own, step.number));
        let softness = self.task.solver.depth.softness;
        scene.loss(scene.image(theta.unsqueeze(), edges, softness, self.depth(&phi)))
    }

    fn judge<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        if self.hard {
            return scene.loss(scene.hard(theta.unsqueeze()));
        }
        let [edge, depth] = JUDGE.map(|scale| {
            let phi = Family::Logistic.default_phi(scale);
            tensor::<B, 1>(phi.clone(), [phi.len()])
        });
        let softness = EdgeSoftness { family: Family::Logistic, squared: false };
        let edges = scene.edges(softness, edge).detach();
        let judge = DepthSoftness::Family(Family::Logistic);
        scene.loss(scene.image(theta.unsqueeze(), edges, judge, depth))
    }

    fn files(
        &self,
        phi: &[f64],
        learning_rate: f64,
        note: &str,
    ) -> anyhow::Result<Vec<(&'static str, String)>> {
        let (edge, depth) = phi.split_at(self.edge.parameters());
        let mut files = self.edge.files(edge, learning_rate, note)?;
        let name = "depth_softness.json";
        let file = DepthSoftnessFile {
            depth_softness: self.task.solver.depth.softness,
            phi: depth.to_vec(),
            note: Some(note.to_owned()),
        };
        files.push((name, file.text(name.as_ref())?));
        Ok(files)
    }

    fn figures(&self, phi: &[f64]) -> Vec<Figure> {
        let (edge, depth) = phi.split_at(self.edge.parameters());
        let mut figures = self.edge.figures::<HostBackend>(edge);
        let curve = |name: &str, phi| Curve { name: name.into(), points: self.weights(phi) };
        figures.push(Figure {
            caption:
                "Logarithm of the weight of a depth, over how near it is: 0 on the far plane, 1 on \
                      the near one. Only differences matter."
                    .into(),
            axes: ["nearness".into(), "logarithm of the weight".into()],
            logarithmic: [false; 2],
            curves: vec![curve("start", &self.task.solver.depth.phi), curve("learned", depth)],
        });
        figures
    }
}
