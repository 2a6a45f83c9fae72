//! Meta-gradients: through many steps, without any gradient, against differences, with broken tasks.

use burn::tensor::Tensor;
use softrast_meta::{
    Adam, InnerLoop, Learner, Measured, MetaGradient, Objective, Problem, Progress, Tasks,
    Validation,
};
use softrast_method::{Method, numbers, tensor};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette, mse_loss};
use softrast_softness::{EdgeSoftness, Family};

use crate::{
    Case, Level, Promise, Tested, Trial,
    drawn::{Exact, largest},
    flat::Flat,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "M01",
        name: "no gradient for 30 steps",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "two triangles, one of them out of reach of the image; 30 steps of Adam, f64",
        perturbation: "epsilon under the root of Adam from 1e-20 to 1e-12",
        measure: "numbers of the meta-gradient that are not finite",
        target: "none",
        run: no_gradient,
    },
    Case {
        id: "M02",
        name: "meta-gradient against differences",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "three triangles and a disk, 12 x 12, 2 and 4 steps of Adam, f64, no clipping",
        perturbation: "steps",
        measure: "relative difference along the scale (all weights of a network) from a central difference",
        target: "at most 1e-3",
        run: differences,
    },
    Case {
        id: "M03",
        name: "meta-gradient through 10 to 200 steps",
        quick: false,
        promise: Promise::Measured,
        scene: "three triangles and a disk, 12 x 12, Adam, f64",
        perturbation: "steps of the inner loop: 10, 50, 100, 200",
        measure: "growth of the adjoint from the last step to the first, in powers of ten, not clipped",
        target: "at most 2 (above, the gradient means nothing, META 2.3)",
        run: growth,
    },
    Case {
        id: "M04",
        name: "clipped meta-gradient",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "as M03, the adjoint clipped as by default",
        perturbation: "steps of the inner loop: 10, 50, 100",
        measure: "norm of the meta-gradient",
        target: "at most 1e3",
        run: clipped,
    },
    Case {
        id: "M05",
        name: "learning with broken tasks",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "three outer steps, batches of four instances, 3 inner steps",
        perturbation: "instances whose target is NaN: one of four, three of four, all",
        measure: "parameters that are not finite (all broken: 1 if that is no error)",
        target: "none",
        run: broken,
    },
];

const SIDE: usize = 12;

/// Loose triangles against an image; the softness is what is learned.
#[derive(Clone)]
struct Triangles {
    silhouette: Silhouette<EdgeSoftness>,
    target: Vec<f64>,
    corners: usize,
    /// What a decay multiplies the last scale by at each step, as logarithms; empty if it stays.
    wider: Vec<f64>,
}

impl Triangles {
    fn new(method: &Method, flat: &Flat, target: Vec<f64>, steps: usize) -> Self {
        let scale = |step| method.scale(step, steps);
        let phi = method.phi(scale(0));
        let phi = tensor::<Exact, 1>(phi.clone(), [phi.len()]);
        let silhouette = Rasterizer::new(SIDE).prepare(&flat.faces, method.softness(), &phi);
        let wider = match method.is_static() {
            true => Vec::new(),
            false => (0..steps).map(|step| (scale(step) / scale(steps)).ln()).collect(),
        };
        Self { silhouette, target, corners: flat.corners.len(), wider }
    }
}

impl<B: RasterBackend> Objective<B> for Triangles {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>) -> Tensor<B, 1> {
        let depth = tensor(vec![2.0; self.corners], [1, self.corners, 1]);
        let vertices = Tensor::cat(vec![theta.reshape([1, self.corners, 2]), depth], 2);
        let target = tensor(self.target.clone(), [1, SIDE, SIDE]);
        mse_loss(self.silhouette.coverage(vertices, phi), target)
    }

    fn loss_at(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, step: usize) -> Tensor<B, 1> {
        // Only the default family decays here, and its one parameter is the logarithm of the scale.
        let wider = self.wider.get(step).copied().unwrap_or(0.0);
        self.loss(theta, phi + wider)
    }
}

/// The image of a disk.
fn disk() -> Vec<f64> {
    let at = |index: usize| (2.0 * index as f64 + 1.0) / SIDE as f64 - 1.0;
    let inside = |k: usize| (at(k % SIDE) - 0.2).hypot(at(k / SIDE) + 0.1) < 0.55;
    (0..SIDE * SIDE).map(|k| f64::from(u8::from(inside(k)))).collect()
}

fn three() -> Flat {
    Flat::loose(vec![
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

type Inner = Problem<Exact, Triangles, Triangles, Adam>;

fn problem(method: &Method, flat: &Flat, target: Vec<f64>, steps: usize, adam: Adam) -> Inner {
    let objective = Triangles::new(method, flat, target, steps);
    let start: Vec<f64> = flat.corners.iter().flat_map(|p| [p[0], p[1]]).collect();
    let referee = Triangles { wider: Vec::new(), ..objective.clone() };
    Problem {
        objective,
        referee,
        inner: InnerLoop { optimizer: adam, steps },
        start: tensor(start.clone(), [start.len()]),
        measured: Measured::End,
    }
}

fn phi(method: &Method) -> Tensor<Exact, 1> {
    let phi = method.phi(method.scale(1, 1));
    let count = phi.len();
    tensor(phi, [count])
}

const SOFT: f64 = 0.08;

fn no_gradient(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SOFT)?;
    let mut corners = three().corners[..6].to_vec();
    corners[3..].iter_mut().for_each(|p| p[0] += 500.0);
    let flat = Flat::loose(corners);
    let level = |epsilon_root: f64| {
        let adam = Adam { epsilon_root, ..Adam::new(0.01) };
        let problem = problem(&method, &flat, disk(), 30, adam);
        let found = MetaGradient::default().estimate(&problem, &phi(&method), 0);
        let gradient = numbers(found.gradient);
        let bad = gradient.iter().filter(|g| !g.is_finite()).count();
        Level::new(epsilon_root, vec![Trial::at_most(bad as f64, 0.0).with(&gradient)])
    };
    Ok([1e-20, 1e-16, 1e-12].map(level).into())
}

fn differences(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    const STEP: f64 = 1e-5;
    let method = tested.method_at(SOFT)?;
    let adam = Adam { epsilon_root: 1e-8, ..Adam::new(0.01) };
    let level = |steps: usize| {
        let problem = problem(&method, &three(), disk(), steps, adam);
        let at = phi(&method);
        // All parameters a little: a network changes its shape, a scale its width.
        // All weights of a network, which change its shape; of the others the scale: a shift of 0 is
        // where the kink of a one-sided family leaves the edge, and has no derivative there.
        let network = tested.family() == Family::Mlp;
        let share = |(k, p): (usize, f64)| if network || k == 0 { 0.3 + p.abs() } else { 0.0 };
        let way: Vec<f64> = numbers(at.clone()).into_iter().enumerate().map(share).collect();
        let way = tensor::<Exact, 1>(way.clone(), [way.len()]);
        let found = MetaGradient::Unrolled { clip: None }.estimate(&problem, &at, 0);
        let slope = numbers((found.gradient.clone() * way.clone()).sum())[0];
        let loss = |by: f64| problem.loss(&(at.clone() + way.clone() * by));
        let difference = (loss(STEP) - loss(-STEP)) / (2.0 * STEP);
        let off = (slope - difference).abs() / difference.abs().max(1e-6);
        let trial = Trial::at_most(off, 1e-3).with(&numbers(found.gradient));
        Level::new(steps as f64, vec![trial])
    };
    Ok([2, 4].map(level).into())
}

fn growth(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SOFT)?;
    let level = |steps: usize| {
        let problem = problem(&method, &three(), disk(), steps, Adam::new(0.01));
        let found = MetaGradient::Unrolled { clip: None }.estimate(&problem, &phi(&method), 0);
        let gradient = numbers(found.gradient);
        let trial = Trial::at_most(found.adjoint_growth, 2.0).with(&gradient);
        Level::new(steps as f64, vec![trial.with(&found.adjoint_norms)])
    };
    Ok([10, 50, 100, 200].map(level).into())
}

fn clipped(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SOFT)?;
    let level = |steps: usize| {
        let problem = problem(&method, &three(), disk(), steps, Adam::new(0.01));
        let found = MetaGradient::default().estimate(&problem, &phi(&method), 0);
        let gradient = numbers(found.gradient);
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        Level::new(steps as f64, vec![Trial::at_most(norm, 1e3).with(&gradient)])
    };
    Ok([10, 50, 100].map(level).into())
}

/// Instances the first `broken` of every four of which have a target that is not a number.
struct SomeBroken<'a> {
    method: &'a Method,
    broken: u64,
}

impl Tasks<Exact> for SomeBroken<'_> {
    type Objective = Triangles;
    type Referee = Triangles;
    type Optimizer = Adam;

    fn problem(&self, seed: u64, _: &Tensor<Exact, 1>) -> Inner {
        let target = if seed % 4 < self.broken { vec![f64::NAN; SIDE * SIDE] } else { disk() };
        problem(self.method, &three(), target, 3, Adam::new(0.01))
    }
}

fn broken(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SOFT)?;
    let level = |broken: u64| {
        let learner = Learner {
            mode: MetaGradient::default(),
            optimizer: Adam::new(0.01),
            clip: 1.0,
            steps: 2,
            batch: 4,
            seed: 0,
            validation: Validation { seed: 1003, count: 1, every: 1, patience: None },
        };
        let tasks = SomeBroken { method: &method, broken };
        let mut progress = Progress::new(numbers(phi(&method)));
        let mut failed = false;
        for _ in 0..3 {
            failed |= learner.advance::<Exact>(&tasks, &mut progress).is_err();
        }
        let bad = progress.phi.iter().filter(|x| !x.is_finite()).count();
        let bad = if broken == 4 && !failed { 1 } else { bad };
        let trial = Trial::at_most(bad as f64, 0.0).with(&[largest(progress.phi.iter().copied())]);
        Level::named(format!("{broken} of 4"), vec![trial])
    };
    Ok([1, 3, 4].map(level).into())
}
