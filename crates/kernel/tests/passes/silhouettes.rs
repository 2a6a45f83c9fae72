//! Silhouette passes give the same bits with every instruction set that walks are compiled for.

use softrast_kernel::{Grid, ImageSize, Inputs, Judged, Kernels, PixelLoss};

use crate::assert_same_with_and_without_vectors;

const VERTICES: usize = 60;
const FACES: u32 = 90;

/// Results of the three passes over random triangles, some of them slivers, points or without area.
fn passes<F: Kernels>(size: [usize; 2], views: usize, far: u32) -> Vec<F> {
    let grid = Grid { outer: 0.3, inner: 0.2, from: [0.0; 2], octaves: 12, far, bits: 2 };
    let wave = |k: usize, step: f64| (step * k as f64).sin();
    let numbers = |count: usize, step: f64| -> Vec<F> {
        (0..count).map(|k| F::from_f64(wave(k, step))).collect()
    };
    let vertex = |k: usize| if k % (3 * VERTICES) < 2 * VERTICES { wave(k, 1.7) } else { 2.0 };
    let vertices: Vec<F> = (0..3 * VERTICES * views).map(|k| F::from_f64(vertex(k))).collect();
    let table = numbers(4 * grid.rows(), 0.7);
    let size = ImageSize::from(size);
    let corner = |k: u32| k % VERTICES as u32;
    // Every seventh face is a line, every eleventh a point.
    let face = |f: u32| match (f % 7, f % 11) {
        (0, _) => [corner(f), corner(f + 1), corner(f)],
        (_, 0) => [corner(f); 3],
        _ => [corner(f), corner(7 * f + 3), corner(11 * f + 8)],
    };
    let faces: Vec<_> = (0..FACES).map(face).collect();
    let inputs = Inputs {
        vertices: &vertices,
        table: &table,
        faces: &faces,
        grid,
        size,
        near: 0.01,
        culls: false,
        views,
        bands: 2,
    };
    let upstream = numbers(views * size.pixels(), 0.3);
    let direction = numbers(vertices.len() + table.len(), 2.3);
    let bands = &F::bands(&inputs);
    let mut all = F::sums(&inputs, bands);
    all.extend(F::sums_vjp(&inputs, bands, &upstream, [true, false]));
    all.extend(F::sums_vjp(&inputs, bands, &upstream, [true; 2]));
    all.extend(F::sums_vjp_of_vjp(&inputs, bands, &upstream, &direction, [true; 2], [true; 3]));
    let along = &direction[..vertices.len()];
    let (along_vertices, wanted) = ([true, false], [true, false, true]);
    all.extend(F::sums_vjp_of_vjp(&inputs, bands, &upstream, along, along_vertices, wanted));
    // Sums as small as those of a softness, so that exponentials are finite.
    let small: Vec<F> = table.iter().map(|&x| x * F::from_f64(0.01)).collect();
    let inputs = Inputs { table: &small, ..inputs };
    for loss in [PixelLoss::SquaredError, PixelLoss::Iou] {
        let target: Vec<F> = upstream.iter().map(|&x| x * x).collect();
        for counted in [None, Some(&target[..])] {
            let judged = Judged { target: &target, counted };
            all.extend(F::losses(&inputs, bands, judged, loss, true).concat());
        }
    }
    all
}

#[test]
fn a_target_that_is_not_finite_leaves_no_trace_in_later_losses() {
    let grid = Grid { outer: 0.3, inner: 0.2, from: [0.0; 2], octaves: 12, far: 0, bits: 2 };
    let table: Vec<_> = (0..4 * grid.rows()).map(|k| 0.01 * (0.7 * k as f64).sin()).collect();
    let inputs = Inputs {
        vertices: &[-0.5, 0.5, 0.0, -0.5, -0.5, 0.5, 2.0, 2.0, 2.0],
        table: &table,
        faces: &[[0, 1, 2]],
        grid,
        size: ImageSize::from([16, 16]),
        near: 0.01,
        culls: false,
        views: 1,
        bands: 1,
    };
    let losses = |target: f64, loss| {
        let target = [target; 256];
        let judged = Judged { target: &target, counted: None };
        f64::losses(&inputs, &f64::bands(&inputs), judged, loss, true)
    };
    // One thread, so that all bands have the same room.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let expected = losses(0.5, PixelLoss::SquaredError);
        assert!(expected.iter().flatten().all(|x| x.is_finite()));
        assert!(expected[1].iter().any(|x| *x != 0.0));
        assert!(losses(f64::NAN, PixelLoss::Iou)[1].iter().any(|x| x.is_nan()));
        assert_eq!(losses(0.5, PixelLoss::SquaredError), expected);
    });
}

fn assert_same_bits<F: Kernels>() {
    for (size, views) in [([50, 50], 1), ([33, 41], 5), ([100, 70], 3)] {
        for far in [0, 9] {
            let name = format!("{size:?} px, {views} views, {far}");
            assert_same_with_and_without_vectors(&name, || passes::<F>(size, views, far));
        }
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    assert_same_bits::<f32>();
    assert_same_bits::<f64>();
}

#[test]
fn bands_of_any_height_give_the_same_sums() {
    // One face over all 400 rows, and 200 in the topmost 25: bands below those are as high as bands may be.
    let size = ImageSize { height: 400, width: 24 };
    let grid = Grid { outer: 0.2, inner: 0.2, from: [0.0; 2], octaves: 12, far: 0, bits: 2 };
    let wave = |k: usize, step: f64| (step * k as f64).sin();
    let table: Vec<f64> = (0..4 * grid.rows()).map(|k| wave(k, 0.7)).collect();
    let count = 602;
    let mut vertices = vec![2.0; 3 * count];
    for k in 0..count {
        (vertices[k], vertices[count + k]) = (wave(k, 1.7), 15.6 + wave(k, 0.9));
    }
    for (k, [x, y]) in [[-2.0, -17.0], [2.0, -17.0], [0.1, 17.0]].into_iter().enumerate() {
        (vertices[599 + k], vertices[count + 599 + k]) = (x, y);
    }
    let mut faces: Vec<[u32; 3]> = (0..199).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    faces.push([599, 600, 601]);
    let (vertices, table, faces) = (&vertices, &table, &faces);
    let sums = |bands| {
        let inputs = Inputs {
            vertices,
            table,
            faces,
            grid,
            size,
            near: 0.01,
            culls: false,
            views: 1,
            bands,
        };
        f64::sums(&inputs, &f64::bands(&inputs))
    };
    let expected = sums(size.height);
    for bands in [2, 3, 4, 50] {
        let found = sums(bands);
        let error = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-8, "{bands} bands: {error:e}");
    }
}
