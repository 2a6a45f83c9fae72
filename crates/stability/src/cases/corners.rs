//! A triangle whose corners are moved until it covers a target.

use burn::tensor::Tensor;
use softrast_method::{numbers, tensor};
use softrast_raster::hard_silhouette;

use super::SCALE;
use crate::{
    Case, Descended, Level, Promise, Tested, Trial,
    descent::{Descent, Loss},
    drawn::{Single, largest},
    flat::{Flat, Random},
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "O02",
        name: "starts without overlap",
        quick: true,
        promise: Promise::Measured,
        scene: "a triangle moved over a target triangle, 32 x 32, 100 steps of 0.02, 6 directions",
        perturbation: "distance of their centres, 0 to 1.4 NDC",
        measure: "hard IoU loss at the best step",
        target: "at most 0.15",
        run: no_overlap,
    },
    Case {
        id: "O26",
        name: "starts without overlap, wide softness",
        quick: false,
        promise: Promise::Measured,
        scene: "as O02, at a distance of 1 NDC",
        perturbation: "softness from 0.001 to 1 NDC",
        measure: "hard IoU loss at the best step",
        target: "at most 0.15",
        run: widths,
    },
    Case {
        id: "O06",
        name: "loss times a factor",
        quick: true,
        promise: Promise::Measured,
        scene: "as O02, at a distance of 0.3 NDC, 30 steps",
        perturbation: "factor of the loss from 1e-8 to 1e8",
        measure: "largest difference of a coordinate from the run with factor 1, in steps",
        target: "at most 0.1 (below 1e-4 the epsilon of Adam shows)",
        run: factors,
    },
    Case {
        id: "O08",
        name: "noise in the target",
        quick: false,
        promise: Promise::Measured,
        scene: "as O02, at a distance of 0.2 NDC, 3 seeds of the noise",
        perturbation: "share of pixels that are flipped, 0 to 20 %",
        measure: "hard IoU loss against the target without noise",
        target: "at most 0.2",
        run: noise,
    },
    Case {
        id: "O09",
        name: "gray target",
        quick: false,
        promise: Promise::Measured,
        scene: "as O02, at a distance of 0.1 NDC; the target hard or averaged over 8 x 8 places a pixel",
        perturbation: "hard or gray",
        measure: "relative error of the triangle's area at the end",
        target: "at most 0.05",
        run: gray,
    },
    Case {
        id: "O27",
        name: "empty, full and one-pixel targets",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a triangle against a target that shows no shape, 32 x 32, 40 steps of both losses",
        perturbation: "empty, full, one pixel, its own image",
        measure: "1 if a loss, coordinate or gradient is not a finite number",
        target: "0",
        run: no_shape,
    },
    Case {
        id: "O19",
        name: "number of threads",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "100 triangles, one step of all corners and its image, 32 x 32",
        perturbation: "1, 2 and 5 threads",
        measure: "numbers that differ in any bit",
        target: "none",
        run: threads,
    },
    Case {
        id: "O18",
        name: "the same run twice",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "as O02, at a distance of 0.3 NDC, 30 steps",
        perturbation: "run again",
        measure: "numbers that differ in any bit",
        target: "none",
        run: twice,
    },
];

const SIDE: usize = 32;
const RATE: f64 = 0.02;
const TARGET: [[f64; 2]; 3] = [[-0.35, -0.3], [0.35, -0.2], [0.0, 0.4]];

/// The target image of the triangle, hard.
fn target() -> Tensor<Single, 3> {
    let flat = Flat::triangle(TARGET);
    hard_silhouette(tensor::<Single, 3>(flat.corners.concat(), [1, 3, 3]), &flat.faces, SIDE)
}

/// A run from the target triangle itself, moved.
#[derive(Clone, Copy)]
struct Moved {
    scale: f64,
    distance: f64,
    /// One of six.
    direction: usize,
    steps: usize,
    learning_rate: f64,
    loss: Loss,
    factor: f64,
}

const MOVED: Moved = Moved {
    scale: SCALE,
    distance: 0.3,
    direction: 0,
    steps: 100,
    learning_rate: RATE,
    loss: Loss::Iou,
    factor: 1.0,
};

impl Moved {
    fn run(self, tested: &Tested, target: &Tensor<Single, 3>) -> anyhow::Result<Descended> {
        let Self { scale, distance, direction, steps, learning_rate, loss, factor } = self;
        let method = tested.method_at(scale)?;
        let faces = Flat::triangle(TARGET).faces;
        let (sin, cos) = (std::f64::consts::TAU * (direction as f64 + 0.2) / 6.0).sin_cos();
        let start = TARGET.iter().flat_map(|[x, y]| [x + distance * cos, y + distance * sin]);
        let (method, faces) = (&method, &faces);
        let descent = Descent { method, faces, size: SIDE, steps, learning_rate, loss, factor };
        Ok(down(&descent, start.collect(), target))
    }
}

/// Runs with x and y of three corners as parameters.
fn down(descent: &Descent, start: Vec<f64>, target: &Tensor<Single, 3>) -> Descended {
    let count = start.len() / 2;
    descent.run(
        tensor(start, [2 * count]),
        target,
        |theta| {
            let depth = tensor(vec![2.0; count], [1, count, 1]);
            Tensor::cat(vec![theta.reshape([1, count, 2]), depth], 2)
        },
        |theta| theta,
    )
}

fn no_overlap(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |distance: f64| {
        let trial = |direction| {
            let end = Moved { distance, direction, ..MOVED }.run(tested, &target())?;
            Ok(Trial::at_most(end.lowest(0), 0.15).with(&end.numbers))
        };
        let trials: anyhow::Result<Vec<Trial>> = (0..6).map(trial).collect();
        Ok(Level::new(distance, trials?))
    };
    [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.4].map(level).into_iter().collect()
}

fn widths(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |scale: f64| {
        let trial = |direction| {
            let end = Moved { scale, distance: 1.0, direction, ..MOVED }.run(tested, &target())?;
            Ok(Trial::at_most(end.lowest(0), 0.15).with(&end.numbers))
        };
        let trials: anyhow::Result<Vec<Trial>> = (0..4).map(trial).collect();
        Ok(Level::new(scale, trials?))
    };
    [1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0].map(level).into_iter().collect()
}

fn factors(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let run = |factor: f64| Moved { factor, steps: 30, ..MOVED }.run(tested, &target());
    let plain = run(1.0)?;
    let level = |factor: f64| {
        let end = run(factor)?;
        let off = end.last().iter().zip(plain.last()).map(|(a, b)| (a - b) / RATE);
        Ok(Level::new(factor, vec![Trial::at_most(largest(off), 0.1).with(&end.numbers)]))
    };
    [1e-8, 1e-6, 1e-4, 1e-2, 1e2, 1e4, 1e8].map(level).into_iter().collect()
}

fn noise(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let clean = target();
    let level = |share: f64| {
        let trial = |seed: u64| {
            let mut random = Random::new(seed);
            let flip = |p: f64| if random.unit() < share { 1.0 - p } else { p };
            let noisy: Vec<f64> = numbers(clean.clone()).into_iter().map(flip).collect();
            let noisy = tensor(noisy, [1, SIDE, SIDE]);
            let end =
                Moved { distance: 0.2, direction: seed as usize, ..MOVED }.run(tested, &noisy)?;
            let corners: Vec<f64> = end.best(0).chunks(2).flat_map(|p| [p[0], p[1], 2.0]).collect();
            let faces = Flat::triangle(TARGET).faces;
            let hard = hard_silhouette(tensor::<Single, 3>(corners, [1, 3, 3]), &faces, SIDE);
            let off = numbers(softrast_raster::iou_loss(hard, clean.clone()))[0];
            Ok(Trial::at_most(off, 0.2).with(&end.numbers))
        };
        let trials: anyhow::Result<Vec<Trial>> = (0..3).map(trial).collect();
        Ok(Level::new(share, trials?))
    };
    [0.0, 0.02, 0.05, 0.1, 0.2].map(level).into_iter().collect()
}

fn gray(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    /// Places a side that a gray pixel is the mean of.
    const PLACES: usize = 8;
    let flat = Flat::triangle(TARGET);
    let corners = tensor::<Single, 3>(flat.corners.concat(), [1, 3, 3]);
    let fine = numbers(hard_silhouette(corners, &flat.faces, PLACES * SIDE));
    let mean = |pixel: usize| {
        let (row, column) = (pixel / SIDE * PLACES, pixel % SIDE * PLACES);
        let at = |k: usize| fine[(row + k / PLACES) * PLACES * SIDE + column + k % PLACES];
        (0..PLACES * PLACES).map(at).sum::<f64>() / (PLACES * PLACES) as f64
    };
    let gray = tensor((0..SIDE * SIDE).map(mean).collect(), [1, SIDE, SIDE]);
    let area =
        |p: &[f64]| 0.5 * ((p[2] - p[0]) * (p[5] - p[1]) - (p[4] - p[0]) * (p[3] - p[1])).abs();
    let level = |(name, target): (&str, Tensor<Single, 3>)| {
        let trial = |direction| {
            let moved = Moved { distance: 0.1, direction, learning_rate: 0.005, ..MOVED };
            let end = Moved { loss: Loss::Mse, ..moved }.run(tested, &target)?;
            let off = (area(end.last()) / area(&TARGET.concat()) - 1.0).abs();
            Ok(Trial::at_most(off, 0.05).with(&end.numbers))
        };
        let trials: anyhow::Result<Vec<Trial>> = (0..3).map(trial).collect();
        Ok(Level::named(name, trials?))
    };
    [("hard", target()), ("gray", gray)].map(level).into_iter().collect()
}

fn no_shape(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let filled = |at: &dyn Fn(usize) -> f64| -> Tensor<Single, 3> {
        tensor((0..SIDE * SIDE).map(at).collect(), [1, SIDE, SIDE])
    };
    let targets = [
        ("empty", filled(&|_| 0.0)),
        ("full", filled(&|_| 1.0)),
        ("one pixel", filled(&|k| f64::from(u8::from(k == 5 * SIDE + 7)))),
        ("its own", target()),
    ];
    let level = |(name, target): (&str, Tensor<Single, 3>)| {
        let trial = |loss: Loss| {
            let end = Moved { distance: 0.0, steps: 40, loss, ..MOVED }.run(tested, &target)?;
            Ok(Trial::at_most(0.0, 0.0).with(&end.numbers))
        };
        let trials: anyhow::Result<Vec<Trial>> =
            [Loss::Iou, Loss::Mse].map(trial).into_iter().collect();
        Ok(Level::named(name, trials?))
    };
    targets.map(level).into_iter().collect()
}

fn threads(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let flat = Flat::random(31, 100);
    let start: Vec<f64> = flat.corners.iter().flat_map(|p| [p[0], p[1]]).collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let descent = Descent {
            method: &method,
            faces: &flat.faces,
            size: SIDE,
            steps: 2,
            learning_rate: RATE,
            loss: Loss::Mse,
            factor: 1.0,
        };
        anyhow::Ok(pool.install(|| down(&descent, start.clone(), &target())).numbers)
    };
    let one = run(1)?;
    let level = |threads: usize| {
        let found = run(threads)?;
        Ok(Level::new(threads as f64, vec![differing(&found, &one)]))
    };
    [1, 2, 5].map(level).into_iter().collect()
}

fn twice(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let run = || Moved { steps: 30, ..MOVED }.run(tested, &target());
    let trial = differing(&run()?.numbers, &run()?.numbers);
    Ok(vec![Level::named("again", vec![trial])])
}

fn differing(found: &[f64], expected: &[f64]) -> Trial {
    let same = found.iter().zip(expected).filter(|(a, b)| a.to_bits() == b.to_bits()).count();
    Trial::at_most((found.len().max(expected.len()) - same) as f64, 0.0).with(found)
}
