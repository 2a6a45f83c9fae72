//! Gradients of an image: against differences, over the pixel grid, at ends of the softness.

use super::SIZE;
use crate::{
    Case, Level, Promise, Tested, Trial,
    drawn::{Drawing, Exact, Single, largest, weights},
    flat::Flat,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "G01",
        name: "grid offset, upright edge",
        quick: true,
        promise: Promise::Measured,
        scene: "an upright edge moved by sixteenths of a pixel, 32 x 32",
        perturbation: "softness from 0.05 to 1 pixel",
        measure: "largest relative deviation of the gradient from its mean over the offsets",
        target: "at most 0.2 (logistic: 14 % at a quarter of a pixel, META 6.6)",
        run: upright,
    },
    Case {
        id: "G02",
        name: "grid offset, turned edges",
        quick: false,
        promise: Promise::Measured,
        scene: "an edge at 10 angles and 8 offsets, 32 x 32",
        perturbation: "softness from 0.05 to 1 pixel",
        measure: "relative standard deviation of the gradient across the edge",
        target: "at most 0.05",
        run: turned,
    },
    Case {
        id: "G03",
        name: "gradient over image sizes",
        quick: false,
        promise: Promise::Measured,
        scene: "a triangle, softness 0.1 NDC",
        perturbation: "image of 16 to 256 pixels a side",
        measure: "relative difference of the gradient of its mean coverage from that at 256",
        target: "at most 2 % where a pixel is at most one softness wide",
        run: sizes,
    },
    Case {
        id: "G04",
        name: "gradient against all pairs",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "12 triangles in f64",
        perturbation: "softness from 0.003 to 0.3 NDC",
        measure: "relative difference of the gradient from that of the definition",
        target: "at most 1e-2",
        run: against_all_pairs,
    },
    Case {
        id: "G05",
        name: "gradient against differences",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a triangle in f64, softness 0.1 NDC, all six coordinates",
        perturbation: "seed of the triangle",
        measure: "relative difference of the gradient from central differences of the image",
        target: "at most 1e-3",
        run: against_differences,
    },
    Case {
        id: "G06",
        name: "gradient from 1e-12 to 1e3",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "12 triangles in f32",
        perturbation: "softness from 1e-12 to 1e3 NDC",
        measure: "numbers of the gradient that are not finite",
        target: "none",
        run: ends,
    },
    Case {
        id: "G07",
        name: "dead zone",
        quick: false,
        promise: Promise::Measured,
        scene: "60 small triangles, 32 x 32",
        perturbation: "softness from 1e-4 to 10 pixels",
        measure: "share of the triangles without any gradient",
        target: "at most 0.02",
        run: dead,
    },
];

/// Width and height of images of half-planes.
const FINE: usize = 32;
/// Width of their pixels in NDC.
const PIXEL: f64 = 2.0 / FINE as f64;

/// The half-plane left of a line through `offset` on the axis that is turned by `angle` from x: only
/// this one of the triangle's sides is in view.
fn half_plane(offset: f64, angle: f64) -> Flat {
    let (sin, cos) = angle.sin_cos();
    let place = |x: f64, y: f64| [cos * x - sin * y, sin * x + cos * y];
    Flat::triangle([place(-60.0, 0.0), place(offset, 40.0), place(offset, -40.0)])
}

/// Gradients of the sum of all pixels by moving each of these lines, an offset and an angle, to its
/// right.
fn pushed(tested: &Tested, scale: f64, lines: &[[f64; 2]]) -> anyhow::Result<Vec<f64>> {
    let method = tested.method_at(scale)?;
    let painter = Drawing::new(&method, &half_plane(0.0, 0.0), FINE).painter::<Exact>();
    let pushed = |&[offset, angle]: &[f64; 2]| {
        let (sin, cos) = angle.sin_cos();
        let g = painter.draw(&half_plane(offset, angle), &[1.0; FINE * FINE]).gradient;
        [1, 2].into_iter().map(|k| g[3 * k] * cos + g[3 * k + 1] * sin).sum()
    };
    Ok(lines.iter().map(pushed).collect())
}

const PIXELS: [f64; 6] = [0.05, 0.1, 0.25, 0.4, 0.5, 1.0];

fn upright(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let lines: Vec<[f64; 2]> = (0..16).map(|k| [0.1 + f64::from(k) / 16.0 * PIXEL, 0.0]).collect();
    let level = |scale: f64| {
        let found = pushed(tested, scale * PIXEL, &lines)?;
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        let most = largest(found.iter().map(|g| g / mean - 1.0));
        Ok(Level::new(scale, vec![Trial::at_most(most, 0.2).with(&found)]))
    };
    PIXELS.map(level).into_iter().collect()
}

fn turned(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let angle = |k: u32| (2.5 + 5.0 * f64::from(k / 8)).to_radians();
    let lines = (0..80).map(|k| [f64::from(k % 8) / 8.0 * PIXEL, angle(k)]);
    let lines: Vec<[f64; 2]> = lines.collect();
    let level = |scale: f64| {
        let mut found = pushed(tested, scale * PIXEL, &lines)?;
        // As much of the line as the image shows.
        let seen = lines.iter().map(|[_, angle]| angle.cos().max(angle.sin()));
        found.iter_mut().zip(seen).for_each(|(g, seen)| *g *= seen);
        let n = found.len() as f64;
        let mean = found.iter().sum::<f64>() / n;
        let spread = (found.iter().map(|g| (g / mean - 1.0).powi(2)).sum::<f64>() / n).sqrt();
        Ok(Level::new(scale, vec![Trial::at_most(spread, 0.05).with(&found)]))
    };
    PIXELS.map(level).into_iter().collect()
}

fn sizes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(0.1)?;
    let flat = Flat::plain();
    let gradient = |size: usize| {
        let share = 1.0 / (size * size) as f64;
        Drawing::new(&method, &flat, size).painter::<Exact>().draw(&flat, &vec![share; size * size])
    };
    let full = gradient(256);
    let level = |size: usize| {
        let drawn = gradient(size);
        let off = drawn.gradient_off(&full, 1e-12);
        // A step of infinite slope needs more pixels than a smooth one.
        let limit = if 2.0 / size as f64 <= 0.1 { 0.02_f64.max(0.5 / size as f64) } else { 1.0 };
        Level::new(size as f64, vec![Trial::at_most(off, limit).with(&drawn.all())])
    };
    Ok([16, 32, 64, 128].map(level).into())
}

fn against_all_pairs(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let flat = Flat::random(12, 12);
    let level = |scale: f64| {
        let method = tested.method_at(scale)?;
        let drawing = Drawing::new(&method, &flat, SIZE);
        let drawn = drawing.fused::<Exact>();
        let off = drawn.gradient_off(&drawing.dense(), 1e-12);
        Ok(Level::new(scale, vec![Trial::at_most(off, 1e-2).with(&drawn.all())]))
    };
    [0.003, 0.01, 0.03, 0.1, 0.3].map(level).into_iter().collect()
}

fn against_differences(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    const STEP: f64 = 1e-6;
    let method = tested.method_at(0.1)?;
    let painter = Drawing::new(&method, &Flat::plain(), SIZE).painter::<Exact>();
    let weights = weights(SIZE);
    let level = |seed: u64| {
        let flat = Flat::random(seed, 1);
        let drawn = painter.draw(&flat, &weights);
        let weighed = |flat: &Flat| {
            let image = painter.draw(flat, &weights).image;
            image.iter().zip(&weights).map(|(a, w)| a * w).sum::<f64>()
        };
        let mut off = Vec::new();
        for k in 0..6 {
            let moved = |by: f64| {
                let mut flat = flat.clone();
                flat.corners[k / 2][k % 2] += by;
                weighed(&flat)
            };
            let difference = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            off.push(drawn.gradient[3 * (k / 2) + k % 2] - difference);
        }
        let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let off = length(&off) / length(&drawn.gradient).max(1e-9);
        Level::named(format!("seed {seed}"), vec![Trial::at_most(off, 1e-3).with(&drawn.all())])
    };
    Ok([21, 22, 23].map(level).into())
}

fn ends(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let flat = Flat::random(13, 12);
    let level = |scale: f64| {
        let method = tested.method_at(scale)?;
        let drawn = Drawing::new(&method, &flat, SIZE).fused::<Single>();
        let bad = drawn.gradient.iter().filter(|g| !g.is_finite()).count();
        Ok(Level::new(scale, vec![Trial::at_most(bad as f64, 0.0).with(&drawn.all())]))
    };
    [1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e3].map(level).into_iter().collect()
}

fn dead(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let mut flat = Flat::random(14, 60);
    flat.corners.chunks_mut(3).for_each(|face| {
        let centre = [0, 1].map(|k| face.iter().map(|p| p[k]).sum::<f64>() / 3.0);
        for corner in face {
            (0..2).for_each(|k| corner[k] = 0.8 * centre[k] + 0.25 * (corner[k] - centre[k]));
        }
    });
    let level = |pixels: f64| {
        let method = tested.method_at(pixels * 2.0 / FINE as f64)?;
        let drawn = Drawing::new(&method, &flat, FINE).fused::<Single>();
        let faces = drawn.gradient.chunks(9);
        let still = faces.filter(|face| face.iter().all(|&g| g == 0.0)).count();
        let share = still as f64 / flat.faces.len() as f64;
        Ok(Level::new(pixels, vec![Trial::at_most(share, 0.02).with(&drawn.all())]))
    };
    [1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.3, 1.0, 10.0].map(level).into_iter().collect()
}
