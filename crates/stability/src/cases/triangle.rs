//! A triangle whose corners are moved until it covers a target.

use std::sync::Arc;

use softrast_inverse::{InverseProblem, SoftnessAt, SolveConfig, Targets};
use softrast_raster::{Projected, RasterBackend, hard_silhouette, iou_loss};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers, tensor};

use super::common::{SCALE, levels};
use crate::{
    Case, Descended, Level, Tested, Trial, descend,
    drawing::{Single, largest},
    planar_scene::{PlanarScene, Random},
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "O02",
        name: "starts without overlap",
        scene: "a triangle moved over a target triangle, 32 x 32, 100 steps of 0.02, 6 directions",
        perturbation: "distance of their centres, 0 to 1.4 NDC",
        measure: "hard IoU loss at the best step",
        target: "at most 0.15",
        run: no_overlap,
    },
    Case {
        id: "O26",
        name: "starts without overlap, wide softness",
        scene: "as O02, at a distance of 1 NDC",
        perturbation: "softness from 0.001 to 1 NDC",
        measure: "hard IoU loss at the best step",
        target: "at most 0.15",
        run: widths,
    },
    Case {
        id: "O06",
        name: "loss times a factor",
        scene: "as O02, at a distance of 0.3 NDC, 30 steps",
        perturbation: "factor of the loss from 1e-8 to 1e8",
        measure: "largest difference of a coordinate from the run with factor 1, in steps",
        target: "at most 0.1 (below 1e-4 the epsilon of Adam shows)",
        run: factors,
    },
    Case {
        id: "O08",
        name: "noise in the target",
        scene: "as O02, at a distance of 0.2 NDC, 3 seeds of the noise",
        perturbation: "share of pixels that are flipped, 0 to 20 %",
        measure: "hard IoU loss against the target without noise",
        target: "at most 0.2",
        run: noise,
    },
    Case {
        id: "O09",
        name: "gray target",
        scene: "as O02, at a distance of 0.1 NDC; the target hard or averaged over 8 x 8 places a pixel",
        perturbation: "hard or gray",
        measure: "relative error of the triangle's area at the end",
        target: "at most 0.05",
        run: gray,
    },
];

const SIDE: usize = 32;
const RATE: f64 = 0.02;
const TARGET: [[f64; 2]; 3] = [[-0.35, -0.3], [0.35, -0.2], [0.0, 0.4]];

/// The hard image of the target triangle.
pub fn target() -> Vec<f64> {
    hard(&PlanarScene::triangle(TARGET), SIDE)
}

fn hard(flat: &PlanarScene, size: usize) -> Vec<f64> {
    let corners = tensor::<Single, 3>(flat.corners.concat(), [1, flat.corners.len(), 3]);
    numbers(hard_silhouette(Projected::new(corners), &flat.faces, size))
}

/// Triangles in the image plane that should cover a target; θ holds x and y of their corners.
pub struct Triangles {
    /// The moving triangles.
    pub flat: PlanarScene,
    /// `[size, size]`.
    pub target: Vec<f64>,
    /// Loss between image and target.
    pub loss: Loss,
    /// Factor of the loss.
    pub factor: f64,
}

/// The minimised loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// One minus the intersection over the union.
    Iou,
    /// Mean squared difference.
    Mse,
}

impl InverseProblem for Triangles {
    type Instance = ();
    type Scene<B: RasterBackend> = Targets<B>;

    fn instance(&self, _seed: u64) -> anyhow::Result<()> {
        Ok(())
    }

    fn scene<B: RasterBackend>(&self, _instances: &[()], size: usize) -> Targets<B> {
        Targets::new(tensor(self.target.clone(), [1, size, size]))
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        Some(self.flat.faces.clone())
    }

    fn start<B: RasterBackend>(&self, _: &Targets<B>) -> Tensor<B, 1> {
        let start: Vec<f64> = self.flat.corners.iter().flat_map(|p| [p[0], p[1]]).collect();
        let count = start.len();
        tensor(start, [count])
    }

    fn image<B: RasterBackend>(
        &self,
        _: &Targets<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        softness.silhouette(at_depth_2(theta)).unsqueeze_dim(1)
    }

    fn hard_image<B: RasterBackend>(
        &self,
        targets: &Targets<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 4> {
        let [_, size, _] = targets.full().dims();
        hard_silhouette(at_depth_2(theta), &self.flat.faces, size).unsqueeze_dim(1)
    }

    fn image_loss<B: RasterBackend>(
        &self,
        targets: &Targets<B>,
        image: Tensor<B, 4>,
    ) -> Tensor<B, 1> {
        let image = image.squeeze_dim(1);
        let loss = match self.loss {
            Loss::Iou => targets.iou_loss(image),
            Loss::Mse => targets.mse_loss(image),
        };
        loss * self.factor
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: SIDE, steps: 100, learning_rate: RATE }
    }
}

/// Corners at depth 2, `[1, corners, 3]`.
pub(super) fn at_depth_2<B: RasterBackend>(theta: Tensor<B, 1>) -> Projected<B> {
    let count = theta.dims()[0] / 2;
    let depth = tensor(vec![2.0; count], [1, count, 1]);
    Projected::new(Tensor::cat(vec![theta.reshape([1, count, 2]), depth], 2))
}

/// A run that starts at the target triangle, moved.
#[derive(Clone, Copy)]
pub struct Moved {
    /// Scale of the softness, in NDC.
    pub scale: f64,
    /// Distance of the start from the target, in NDC.
    pub distance: f64,
    /// Direction of the start, one of six.
    pub direction: usize,
    /// Steps of Adam.
    pub steps: usize,
    /// Learning rate of Adam.
    pub learning_rate: f64,
    /// The minimised loss.
    pub loss: Loss,
    /// Factor of the loss.
    pub factor: f64,
}

/// Settings of most cases.
pub const MOVED: Moved = Moved {
    scale: SCALE,
    distance: 0.3,
    direction: 0,
    steps: 100,
    learning_rate: RATE,
    loss: Loss::Iou,
    factor: 1.0,
};

impl Moved {
    /// Optimises towards a target.
    ///
    /// # Errors
    ///
    /// None for a scene of plain numbers.
    pub fn run(self, tested: &Tested, target: &[f64]) -> anyhow::Result<Descended> {
        let Self { scale, distance, direction, steps, learning_rate, loss, factor } = self;
        let (sin, cos) = (std::f64::consts::TAU * (direction as f64 + 0.2) / 6.0).sin_cos();
        let flat =
            PlanarScene::triangle(TARGET.map(|[x, y]| [x + distance * cos, y + distance * sin]));
        let problem = Triangles { flat, target: target.to_vec(), loss, factor };
        descend(&problem, &[()], tested.at(scale), SolveConfig { size: SIDE, steps, learning_rate })
    }
}

fn no_overlap(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.4], |distance: f64| {
        let trial = |direction| {
            let end = Moved { distance, direction, ..MOVED }.run(tested, &target())?;
            Ok(Trial::at_most(end.lowest(0), 0.15).with(&end.numbers))
        };
        Ok(Level::new(distance, (0..6).map(trial).collect::<anyhow::Result<_>>()?))
    })
}

fn widths(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0], |scale: f64| {
        let trial = |direction| {
            let end = Moved { scale, distance: 1.0, direction, ..MOVED }.run(tested, &target())?;
            Ok(Trial::at_most(end.lowest(0), 0.15).with(&end.numbers))
        };
        Ok(Level::new(scale, (0..4).map(trial).collect::<anyhow::Result<_>>()?))
    })
}

fn factors(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let run = |factor: f64| Moved { factor, steps: 30, ..MOVED }.run(tested, &target());
    let plain = run(1.0)?;
    levels([1e-8, 1e-6, 1e-4, 1e-2, 1e2, 1e4, 1e8], |factor: f64| {
        let end = run(factor)?;
        let off = end.last().iter().zip(plain.last()).map(|(a, b)| (a - b) / RATE);
        Ok(Level::new(factor, vec![Trial::at_most(largest(off), 0.1).with(&end.numbers)]))
    })
}

fn noise(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let clean = target();
    levels([0.0, 0.02, 0.05, 0.1, 0.2], |share: f64| {
        let trial = |seed: u64| {
            let mut random = Random::new(seed);
            let flip = |p: f64| if random.unit() < share { 1.0 - p } else { p };
            let noisy: Vec<f64> = clean.iter().copied().map(flip).collect();
            let end =
                Moved { distance: 0.2, direction: seed as usize, ..MOVED }.run(tested, &noisy)?;
            let found = end.best(0).chunks(2).map(|p| [p[0], p[1], 2.0]).collect();
            let image = |values: Vec<f64>| tensor::<Single, 3>(values, [1, SIDE, SIDE]);
            let found = image(hard(&PlanarScene::loose(found), SIDE));
            let off = numbers(iou_loss(found, image(clean.clone())))[0];
            Ok(Trial::at_most(off, 0.2).with(&end.numbers))
        };
        Ok(Level::new(share, (0..3).map(trial).collect::<anyhow::Result<_>>()?))
    })
}

fn gray(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    /// Samples along each side of a gray pixel, which is their mean.
    const PLACES: usize = 8;
    let fine = hard(&PlanarScene::triangle(TARGET), PLACES * SIDE);
    let mean = |pixel: usize| {
        let (row, column) = (pixel / SIDE * PLACES, pixel % SIDE * PLACES);
        let at = |k: usize| fine[(row + k / PLACES) * PLACES * SIDE + column + k % PLACES];
        (0..PLACES * PLACES).map(at).sum::<f64>() / (PLACES * PLACES) as f64
    };
    let gray = (0..SIDE * SIDE).map(mean).collect();
    let area =
        |p: &[f64]| 0.5 * ((p[2] - p[0]) * (p[5] - p[1]) - (p[4] - p[0]) * (p[3] - p[1])).abs();
    levels([("hard", target()), ("gray", gray)], |(name, target): (&str, Vec<f64>)| {
        let trial = |direction| {
            let moved = Moved { distance: 0.1, direction, learning_rate: 0.005, ..MOVED };
            let end = Moved { loss: Loss::Mse, ..moved }.run(tested, &target)?;
            let off = (area(end.last()) / area(&TARGET.concat()) - 1.0).abs();
            Ok(Trial::at_most(off, 0.05).with(&end.numbers))
        };
        let trials: anyhow::Result<Vec<Trial>> = (0..3).map(trial).collect();
        Ok(Level::named(name, trials?))
    })
}
