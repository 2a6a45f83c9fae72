//! Meta-gradients through many steps.

use softrast_inverse::{ScaleSchedule, ScheduledSoftness};
use softrast_meta::{Adam, BilevelProblem, InnerLoop, MetaGradient, Objective, OuterSteps};
use softrast_raster::{
    RasterBackend,
    low_level::{Rasterizer, Silhouette},
    mse_loss,
};
use softrast_softness::EdgeSoftness;
use softrast_tensor::{Tensor, numbers, tensor};

use super::triangle::at_depth_2;
use crate::{Case, Level, Tested, Trial, drawing::Exact, planar_scene::PlanarScene};

pub(super) const CASES: &[Case] = &[Case {
    id: "M03",
    name: "meta-gradient through 10 to 200 steps",
    scene: "three triangles and a disk, 12 x 12, Adam, f64",
    perturbation: "steps of the inner loop: 10, 50, 100, 200",
    measure: "growth of the adjoint from the last step to the first, in powers of ten, not clipped",
    target: "at most 2 (above, the gradient means nothing)",
    run: growth,
}];

/// Pixels a side.
pub const SIDE: usize = 12;

/// Loose triangles compared with an image; the softness is learned.
#[derive(Clone)]
pub struct Triangles {
    silhouette: Silhouette<EdgeSoftness>,
    target: Vec<f64>,
    /// Logarithms of the factors by which a decay is wider than its last scale, one per step; empty for a fixed width.
    wider: Vec<f64>,
}

impl Triangles {
    fn new(
        softness: &ScheduledSoftness,
        flat: &PlanarScene,
        target: Vec<f64>,
        steps: usize,
    ) -> Self {
        let scale = |step| softness.scale_at(ScaleSchedule::progress(step, steps), SIDE);
        let phi = softness.phi_at(0.0, SIDE);
        let phi = tensor::<Exact, 1>(phi.clone(), [phi.len()]);
        let silhouette = Rasterizer::new(SIDE).prepare(&flat.faces, softness.softness, &phi);
        let wider = match softness.is_constant() {
            true => Vec::new(),
            false => (0..steps).map(|step| (scale(step) / scale(steps)).ln()).collect(),
        };
        Self { silhouette, target, wider }
    }
}

impl<B: RasterBackend> Objective<B> for Triangles {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, step: usize) -> Tensor<B, 1> {
        // Only the default family decays here, and its one parameter is the logarithm of the scale.
        let wider = self.wider.get(step).copied().unwrap_or(0.0);
        let target = tensor(self.target.clone(), [1, SIDE, SIDE]);
        mse_loss(self.silhouette.coverage(at_depth_2(theta).tensor(), phi + wider), target)
    }
}

/// The image of a disk.
pub fn disk() -> Vec<f64> {
    let at = |index: usize| (2.0 * index as f64 + 1.0) / SIDE as f64 - 1.0;
    let inside = |k: usize| (at(k % SIDE) - 0.2).hypot(at(k / SIDE) + 0.1) < 0.55;
    (0..SIDE * SIDE).map(|k| f64::from(u8::from(inside(k)))).collect()
}

/// Three triangles that overlap.
pub fn three() -> PlanarScene {
    PlanarScene::loose(vec![
        [-0.7, -0.5, 2.0],
        [0.1, -0.6, 2.0],
        [-0.2, 0.3, 2.0],
        [0.0, -0.2, 2.0],
        [0.7, 0.0, 2.0],
        [0.2, 0.6, 2.0],
        [-0.5, 0.1, 2.0],
        [0.3, 0.4, 2.0],
        [-0.3, 0.8, 2.0],
    ])
}

/// Learns the softness from the result of an inner loop.
pub type Inner = BilevelProblem<Exact, Triangles, Triangles, Adam>;

/// Moves triangles to a target `[12, 12]`.
pub fn problem(
    softness: &ScheduledSoftness,
    flat: &PlanarScene,
    target: Vec<f64>,
    steps: usize,
    adam: Adam,
) -> Inner {
    let objective = Triangles::new(softness, flat, target, steps);
    let start: Vec<f64> = flat.corners.iter().flat_map(|p| [p[0], p[1]]).collect();
    let outer_loss = Triangles { wider: Vec::new(), ..objective.clone() };
    BilevelProblem {
        objective,
        outer_loss,
        inner: InnerLoop { optimizer: adam, steps },
        start: tensor(start.clone(), [start.len()]),
        outer_steps: OuterSteps::Last,
    }
}

/// The learned parameters: those of the last step.
pub fn phi(softness: &ScheduledSoftness) -> Tensor<Exact, 1> {
    let phi = softness.phi_at(1.0, SIDE);
    let count = phi.len();
    tensor(phi, [count])
}

/// Scale of the softness.
pub const SOFT: f64 = 0.08;

fn growth(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let softness = tested.at(SOFT);
    let level = |steps: usize| {
        let problem = problem(&softness, &three(), disk(), steps, Adam::new(0.01));
        let found = MetaGradient::Unrolled { clip: None }.estimate(&problem, &phi(&softness), 0);
        let gradient = numbers(found.gradient);
        let trial = Trial::at_most(found.adjoint_growth, 2.0).with(&gradient);
        Level::new(steps as f64, vec![trial.with(&found.adjoint_norms)])
    };
    Ok([10, 50, 100, 200].map(level).into())
}
