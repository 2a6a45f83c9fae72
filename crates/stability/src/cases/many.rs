//! Many faces on a pixel, and none at all.

use std::sync::Arc;

use softrast_method::numbers;
use softrast_raster::Rasterizer;
use softrast_softness::Softness;

use super::{SCALE, SIZE};
use crate::{
    Case, Level, Promise, Tested, Trial,
    drawn::{Drawing, Exact, Single},
    flat::Flat,
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "F06",
        name: "copies of a face",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "the same triangle n times",
        perturbation: "n from 1 to 64",
        measure: "largest error of a pixel against 1 - (1 - s)^n",
        target: "at most 1e-5",
        run: copies,
    },
    Case {
        id: "F09",
        name: "nothing, everything, far away",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a triangle far outside the image, one around all of it",
        perturbation: "where it is",
        measure: "largest distance of a pixel from 0 and from 1",
        target: "at most 1e-5 (outside by 100 scales and more)",
        run: extremes,
    },
    Case {
        id: "F10",
        name: "stacks up to 10,000 faces",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "the same triangle n times, seen by a wide softness",
        perturbation: "n from 100 to 10,000",
        measure: "largest error of a pixel against 1 - (1 - s)^n, in f32",
        target: "at most 1e-5 and n roundings",
        run: stacks,
    },
    Case {
        id: "F11",
        name: "haze of many faces",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "n triangles outside the image, a hundred scales away",
        perturbation: "n from 16 to 1,280",
        measure: "largest pixel",
        target: "at most 1e-3",
        run: haze,
    },
    Case {
        id: "F14",
        name: "10,000 faces in a pixel",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "a square of 0.5 % of a pixel, split into ever more faces",
        perturbation: "faces from 128 to 10,000",
        measure: "share of finite pixels that is missing",
        target: "0, and no pixel above 1",
        run: crowd,
    },
    Case {
        id: "F16",
        name: "a square split into triangles",
        quick: false,
        promise: Promise::Measured,
        scene: "a square of 2 to 512 triangles, softness 0.02 NDC",
        perturbation: "length of an edge of its triangles, in scales",
        measure: "how far the outline (coverage 1/2) moves outwards, in scales",
        target: "at most 0.5 (only exact if edges are 5 scales and longer, META 6.7)",
        run: split,
    },
    Case {
        id: "F20",
        name: "image sizes",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "a triangle, softness 0.1 NDC",
        perturbation: "image of 8 to 1024 pixels a side",
        measure: "difference of its mean coverage from that at 1024",
        target: "at most half a pixel's width",
        run: sizes,
    },
];

/// `1 - (1 - s)^count` of one triangle, from the definition.
fn stacked(tested: &Tested, scale: f64, count: usize) -> anyhow::Result<Vec<f64>> {
    let method = tested.method_at(scale)?;
    let one = Drawing::new(&method, &Flat::plain(), SIZE).dense();
    Ok(one.image.iter().map(|a| -((1.0 - a).ln() * count as f64).exp_m1()).collect())
}

fn worst(found: &[f64], expected: &[f64]) -> f64 {
    crate::drawn::largest(found.iter().zip(expected).map(|(a, b)| a - b))
}

fn copies(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |count: usize| {
        let method = tested.method_at(0.1)?;
        let drawn = Drawing::new(&method, &Flat::stack(count), SIZE).fused::<Exact>();
        let off = worst(&drawn.image, &stacked(tested, 0.1, count)?);
        Ok(Level::new(count as f64, vec![Trial::at_most(off, 1e-5).with(&drawn.all())]))
    };
    [1, 2, 4, 16, 64].map(level).into_iter().collect()
}

fn stacks(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |count: usize| {
        let method = tested.method_at(0.3)?;
        let drawn = Drawing::new(&method, &Flat::stack(count), SIZE).fused::<Single>();
        let off = worst(&drawn.image, &stacked(tested, 0.3, count)?);
        let limit = 1e-5 + f64::from(f32::EPSILON) * count as f64;
        Ok(Level::new(count as f64, vec![Trial::at_most(off, limit).with(&drawn.all())]))
    };
    [100, 1000, 10_000].map(level).into_iter().collect()
}

fn extremes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let far = |x: f64| Flat::triangle([[x, x], [x + 1.0, x], [x, x + 1.0]]);
    let around = Flat::triangle([[-1e3, -1e3], [1e3, -1e3], [0.0, 2e3]]);
    let method = tested.method_at(SCALE)?;
    let level = |(name, flat, expected): (&str, Flat, f64)| {
        let drawn = Drawing::new(&method, &flat, SIZE).fused::<Single>();
        let off = worst(&drawn.image, &vec![expected; SIZE * SIZE]);
        Level::named(name, vec![Trial::at_most(off, 1e-5).with(&drawn.all())])
    };
    Ok([("outside", far(5.0), 0.0), ("far outside", far(1e6), 0.0), ("around", around, 1.0)]
        .map(level)
        .into())
}

fn haze(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(0.01)?;
    let level = |count: usize| {
        let corners = [[2.0, -0.5, 2.0], [3.0, 0.0, 2.0], [2.0, 0.5, 2.0]];
        let flat = Flat::loose((0..count).flat_map(|_| corners).collect());
        let drawn = Drawing::new(&method, &flat, SIZE).fused::<Single>();
        let most = crate::drawn::largest(drawn.image.iter().copied());
        Level::new(count as f64, vec![Trial::at_most(most, 1e-3).with(&drawn.all())])
    };
    Ok([16, 128, 1280].map(level).into())
}

fn crowd(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let method = tested.method_at(SCALE)?;
    let level = |side: usize| {
        let flat = Flat::grid(side).scaled(0.07 * 2.0 / SIZE as f64);
        let drawn = Drawing::new(&method, &flat, SIZE).fused::<Single>();
        let sound = drawn.image.iter().filter(|a| (0.0..=1.0).contains(*a)).count();
        let missing = 1.0 - sound as f64 / drawn.image.len() as f64;
        let faces = flat.faces.len() as f64;
        Level::new(faces, vec![Trial::at_most(missing, 0.0).with(&drawn.all())])
    };
    Ok([8, 32, 71].map(level).into())
}

fn split(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    const SCALE: f64 = 0.02;
    /// Pixels of the row across the right side of the square.
    const FINE: usize = 512;
    let method = tested.method_at(SCALE)?;
    let level = |side: usize| {
        let flat = Flat::grid(side);
        let drawn = Drawing::new(&method, &flat, FINE).fused::<Single>();
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

fn sizes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    const SCALE: f64 = 0.1;
    let method = tested.method_at(SCALE)?;
    let flat = Flat::plain();
    let faces: Arc<[[u32; 3]]> = flat.faces.clone();
    let last = method.phi(method.scale(1, 1));
    debug_assert_eq!(last.len(), method.softness().parameters());
    let mean = |size: usize| {
        let phi = softrast_method::tensor::<Single, 1>(last.clone(), [last.len()]);
        let silhouette = Rasterizer::new(size).prepare(&faces, method.softness(), &phi);
        let vertices = softrast_method::tensor::<Single, 3>(flat.corners.concat(), [1, 3, 3]);
        let image = numbers(silhouette.coverage(vertices, phi));
        image.iter().sum::<f64>() / image.len() as f64
    };
    let full = mean(1024);
    let level = |size: usize| {
        Level::new(size as f64, vec![Trial::at_most((mean(size) - full).abs(), 1.0 / size as f64)])
    };
    Ok([8, 16, 32, 64, 256, 1024].map(level).into())
}
