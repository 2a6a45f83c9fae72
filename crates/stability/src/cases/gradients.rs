//! Gradients over the pixel grid, and an outline that depends on how faces are split.

use super::common::levels;
use crate::{
    Case, Level, Tested, Trial,
    drawing::{Exact, RenderRequest, Single, largest},
    planar_scene::PlanarScene,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "F16",
        name: "a square split into triangles",
        scene: "a square of 2 to 512 triangles, softness 0.02 NDC",
        perturbation: "length of an edge of its triangles, in scales",
        measure: "how far the outline (coverage 1/2) moves outwards, in scales",
        target: "at most 0.5 (only exact if edges are 5 scales and longer)",
        run: split,
    },
    Case {
        id: "G01",
        name: "grid offset, upright edge",
        scene: "an upright edge moved by sixteenths of a pixel, 32 x 32",
        perturbation: "softness from 0.05 to 1 pixel",
        measure: "largest relative deviation of the gradient from its mean over the offsets",
        target: "at most 0.2 (logistic: 14 % at a quarter of a pixel)",
        run: upright,
    },
    Case {
        id: "G02",
        name: "grid offset, turned edges",
        scene: "an edge at 10 angles and 8 offsets, 32 x 32",
        perturbation: "softness from 0.05 to 1 pixel",
        measure: "relative standard deviation of the gradient across the edge",
        target: "at most 0.05",
        run: turned,
    },
    Case {
        id: "G03",
        name: "gradient over image sizes",
        scene: "a triangle, softness 0.1 NDC",
        perturbation: "image of 16 to 256 pixels a side",
        measure: "relative difference of the gradient of its mean coverage from that at 256",
        target: "at most 2 % where a pixel is at most one softness wide",
        run: sizes,
    },
    Case {
        id: "G07",
        name: "dead zone",
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

fn split(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    const SCALE: f64 = 0.02;
    /// Pixels of the row across the right side of the square.
    const FINE: usize = 512;
    let method = tested.at(SCALE);
    let level = |side: usize| {
        let flat = PlanarScene::grid(side);
        let drawn = RenderRequest::new(&method, &flat, FINE).fused::<Single>();
        // Off the middle, where no edge of a triangle meets the side of the square.
        let row = &drawn.image[FINE * (FINE / 2 + 37)..][..FINE];
        let last = row.iter().rposition(|&a| a >= 0.5).unwrap_or(0);
        let at = |column: usize| (2 * column + 1) as f64 / FINE as f64 - 1.0;
        let next = row.get(last + 1).copied().unwrap_or(0.0);
        let between = (row[last] - 0.5) / (row[last] - next).max(1e-12);
        let outline = at(last) + between.clamp(0.0, 1.0) * 2.0 / FINE as f64;
        let shift = (outline - 0.5).abs() / SCALE;
        let edge = 1.0 / side as f64 / SCALE;
        Level::new(edge, vec![Trial::at_most(shift, 0.5).with(&drawn.all())])
    };
    Ok([1, 2, 4, 8, 16].map(level).into())
}

/// The half-plane left of a line through `offset` on the axis that is turned by `angle` from x: only
/// this one of the triangle's sides is in view.
fn half_plane(offset: f64, angle: f64) -> PlanarScene {
    let (sin, cos) = angle.sin_cos();
    let place = |x: f64, y: f64| [cos * x - sin * y, sin * x + cos * y];
    PlanarScene::triangle([place(-60.0, 0.0), place(offset, 40.0), place(offset, -40.0)])
}

/// Gradients of the sum of all pixels with respect to moving each of these lines (offset, angle) to its right.
fn pushed(tested: &Tested, scale: f64, lines: &[[f64; 2]]) -> anyhow::Result<Vec<f64>> {
    let method = tested.at(scale);
    let renderer = RenderRequest::new(&method, &half_plane(0.0, 0.0), FINE).renderer::<Exact>();
    let pushed = |&[offset, angle]: &[f64; 2]| {
        let (sin, cos) = angle.sin_cos();
        let g = renderer.draw(&half_plane(offset, angle), &[1.0; FINE * FINE]).gradient;
        [1, 2].into_iter().map(|k| g[3 * k] * cos + g[3 * k + 1] * sin).sum()
    };
    Ok(lines.iter().map(pushed).collect())
}

const PIXELS: [f64; 6] = [0.05, 0.1, 0.25, 0.4, 0.5, 1.0];

fn upright(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let lines: Vec<[f64; 2]> = (0..16).map(|k| [0.1 + f64::from(k) / 16.0 * PIXEL, 0.0]).collect();
    levels(PIXELS, |scale: f64| {
        let found = pushed(tested, scale * PIXEL, &lines)?;
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        let most = largest(found.iter().map(|g| g / mean - 1.0));
        Ok(Level::new(scale, vec![Trial::at_most(most, 0.2).with(&found)]))
    })
}

fn turned(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let angle = |k: u32| (2.5 + 5.0 * f64::from(k / 8)).to_radians();
    let lines = (0..80).map(|k| [f64::from(k % 8) / 8.0 * PIXEL, angle(k)]);
    let lines: Vec<[f64; 2]> = lines.collect();
    levels(PIXELS, |scale: f64| {
        let mut found = pushed(tested, scale * PIXEL, &lines)?;
        // As much of the line as the image shows.
        let seen = lines.iter().map(|[_, angle]| angle.cos().max(angle.sin()));
        found.iter_mut().zip(seen).for_each(|(g, seen)| *g *= seen);
        let n = found.len() as f64;
        let mean = found.iter().sum::<f64>() / n;
        let spread = (found.iter().map(|g| (g / mean - 1.0).powi(2)).sum::<f64>() / n).sqrt();
        Ok(Level::new(scale, vec![Trial::at_most(spread, 0.05).with(&found)]))
    })
}

fn sizes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.at(0.1);
    let flat = PlanarScene::plain();
    let gradient = |size: usize| {
        let share = 1.0 / (size * size) as f64;
        RenderRequest::new(&method, &flat, size)
            .renderer::<Exact>()
            .draw(&flat, &vec![share; size * size])
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

fn dead(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let mut flat = PlanarScene::random(14, 60);
    flat.corners.chunks_mut(3).for_each(|face| {
        let centre = [0, 1].map(|k| face.iter().map(|p| p[k]).sum::<f64>() / 3.0);
        for corner in face {
            (0..2).for_each(|k| corner[k] = 0.8 * centre[k] + 0.25 * (corner[k] - centre[k]));
        }
    });
    levels([1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.3, 1.0, 10.0], |pixels: f64| {
        let method = tested.at(pixels * 2.0 / FINE as f64);
        let drawn = RenderRequest::new(&method, &flat, FINE).fused::<Single>();
        let faces = drawn.gradient.chunks(9);
        let still = faces.filter(|face| face.iter().all(|&g| g == 0.0)).count();
        let share = still as f64 / flat.faces.len() as f64;
        Ok(Level::new(pixels, vec![Trial::at_most(share, 0.02).with(&drawn.all())]))
    })
}
