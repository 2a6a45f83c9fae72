//! Colour passes give the same bits with every instruction set that walks are compiled for.

use std::ops::Range;

use softrast_kernel::{
    Grid, ImageSize, Kernels,
    blend::{DepthGrid, Inputs},
};

use crate::assert_same_with_and_without_vectors;

const VERTICES: usize = 40;
const FACES: u32 = 50;

/// Results of the three passes over random triangles, some of them points or without area.
fn passes<F: Kernels>(
    channels: usize,
    views: usize,
    log_weight: f64,
    floor: f64,
    depth: DepthGrid,
    texture_size: Option<[usize; 2]>,
) -> Vec<F> {
    let edge = Grid { outer: 0.2, inner: 0.3, from: [0.0; 2], octaves: 12, far: 5, bits: 2 };
    let wave = |k: usize, step: f64| (step * k as f64).sin();
    let numbers = |count: usize, step: f64| -> Vec<F> {
        (0..count).map(|k| F::from_f64(wave(k, step))).collect()
    };
    let coordinate = |k: usize| {
        let depth = k % (3 * VERTICES) >= 2 * VERTICES;
        wave(k, 1.7) + if depth { 2.5 } else { 0.0 }
    };
    let vertices: Vec<F> = (0..3 * VERTICES * views).map(|k| F::from_f64(coordinate(k))).collect();
    let attributes = numbers(VERTICES * if texture_size.is_some() { 2 } else { channels }, 0.9);
    let texture = numbers(texture_size.map_or(0, |[height, width]| 4 * height * width), 1.1);
    let tables = numbers(4 * (edge.rows() + depth.rows()), 0.7);
    let mut background = numbers(channels, 0.2);
    background.push(F::from_f64(log_weight));
    let corner = |k: u32| k % VERTICES as u32;
    let face = |f: u32| match (f % 7, f % 11) {
        (0, _) => [corner(f), corner(f + 1), corner(f)],
        (_, 0) => [corner(f); 3],
        _ => [corner(f), corner(7 * f + 3), corner(11 * f + 8)],
    };
    let faces: Vec<_> = (0..FACES).map(face).collect();
    let size = ImageSize::from([37, 50]);
    let inputs = Inputs {
        vertices: &vertices,
        attributes: &attributes,
        tables: &tables,
        background: &background,
        texture: &texture,
        texture_size,
        faces: &faces,
        entries: &faces,
        edge,
        depth,
        floor,
        planes: [1.0, 4.0],
        size,
        near: 0.01,
        far: 1e15,
        culls: false,
        tolerance: 1e-3,
        views,
        shared: true,
    };
    let upstream = numbers(views * (channels + 1) * size.pixels(), 0.3);
    let lengths = [&vertices, &attributes, &tables, &texture].map(Vec::len);
    let direction = numbers(lengths.iter().sum::<usize>() + background.len(), 2.3);
    let kept = &F::kept(&inputs, false);
    let mut all = F::blend(&inputs, kept);
    all.extend(F::blend_vjp(&inputs, kept, &upstream, [true; 5]));
    all.extend(F::blend_vjp(&inputs, kept, &upstream, [true, false, false, false, false]));
    all.extend(F::blend_vjp_of_vjp(&inputs, kept, &upstream, &direction, [true; 5], [true; 6]));
    // The cached sums of an image also serve the gradient.
    let kept = &F::kept(&inputs, true);
    let again =
        [F::blend(&inputs, kept), F::blend_vjp(&inputs, kept, &upstream, [true; 5])].concat();
    assert!(format!("{again:?}") == format!("{:?}", &all[..again.len()]));
    all.extend(judged(&inputs, &upstream));
    all
}

/// Losses and gradients of bands that are judged as they are drawn. Image and gradient have the bits of `blend` and `blend_vjp`.
fn judged<F: Kernels>(inputs: &Inputs<F>, upstream: &[F]) -> Vec<F> {
    let kept = &F::kept(inputs, false);
    let image = F::blend(inputs, kept);
    let (pixels, planes) = (inputs.size.pixels(), inputs.background.len());
    let judge = |view: usize, rows: Range<usize>, seen: &[Vec<F>], to: &mut [Vec<F>]| {
        let mut sum = F::ZERO;
        for (plane, (seen, to)) in seen.iter().zip(to).enumerate() {
            let first = (view * planes + plane) * pixels;
            let own = first + rows.start..first + rows.end;
            assert!(format!("{seen:?}") == format!("{:?}", &image[own.clone()]));
            to.copy_from_slice(&upstream[own]);
            sum += seen.iter().zip(to).fold(F::ZERO, |sum, (&a, &mut b)| sum + a * b);
        }
        sum
    };
    let wanted = [true, true, false, true, true];
    let [losses, gradient] = F::blend_judged(inputs, kept, &judge, wanted);
    assert_eq!(losses.len(), inputs.views);
    let expected = F::blend_vjp(inputs, kept, upstream, wanted);
    assert!(format!("{gradient:?}") == format!("{expected:?}"));
    [losses, gradient].concat()
}

/// Bands with more pairs than are recorded: the rest is walked twice.
#[test]
fn pairs_beyond_the_room_for_records_are_walked_twice() {
    let edge = Grid { outer: 6.0, inner: 6.0, from: [0.0; 2], octaves: 12, far: 0, bits: 2 };
    let mut tables =
        edge.table(|d| [(d / 0.5).exp().ln_1p(), (1.0 + (-d / 0.5).exp()).recip() / 0.5]);
    tables.extend([1.0, 0.0, 0.0, 0.0]);
    // 200 faces over all of 64 x 64 pixels: some 100,000 pairs of eight pixels and a face.
    let faces: Vec<_> = (0..200).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let wave = |k: usize| (1.7 * k as f64).sin();
    let vertices: Vec<f64> =
        (0..1800).map(|k| wave(k) + if k >= 1200 { 2.5 } else { 0.0 }).collect();
    let attributes: Vec<f64> = (0..1800).map(wave).collect();
    let size = ImageSize::from(64);
    let inputs = Inputs {
        vertices: &vertices,
        attributes: &attributes,
        tables: &tables,
        background: &[0.1, 0.2, 0.3, -2.0],
        texture: &[],
        texture_size: None,
        faces: &faces,
        entries: &faces,
        edge,
        depth: DepthGrid::Exponential,
        floor: 0.0,
        planes: [1.0, 4.0],
        size,
        near: 0.01,
        far: 1e15,
        tolerance: 1e-6,
        culls: false,
        views: 1,
        shared: true,
    };
    let upstream: Vec<f64> = (0..4 * size.pixels()).map(wave).collect();
    judged(&inputs, &upstream);
}

fn assert_same_bits<F: Kernels>() {
    let table = DepthGrid::Table(Grid {
        outer: 1e-3,
        inner: 2.0,
        from: [0.0; 2],
        octaves: 10,
        far: 0,
        bits: 2,
    });
    let line = DepthGrid::Line { floor: 1e-7 };
    // A background of little weight requires the largest weight of each pixel.
    for (channels, views, log_weight, floor, depth, texture) in [
        (2, 1, -2.0, 0.0, table, None),
        (7, 4, -1.0, 1e-7, line, None),
        (4, 3, -700.0, 1e-7, table, None),
        (3, 3, -1.0, 0.0, DepthGrid::Exponential, None),
        (3, 2, -1.0, 1e-7, DepthGrid::Exponential, None),
        (2, 2, -2.0, 0.0, table, Some([9, 13])),
        (4, 2, -2.0, 0.0, table, Some([9, 13])),
    ] {
        let passes = || passes::<F>(channels, views, log_weight, floor, depth, texture);
        assert_same_with_and_without_vectors(&format!("{views} views"), passes);
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    assert_same_bits::<f32>();
    assert_same_bits::<f64>();
}
