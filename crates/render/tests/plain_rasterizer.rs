//! Compares a textured mesh in colour with a rasterizer without softness.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{path::Path, process::Command};

use image::RgbImage;
use softrast_mesh::Mesh;

const SIZE: usize = 128;
const SAMPLES: usize = 4;
const DISTANCE: f64 = 2.5;

/// x and y in samples from the top left, and depth, of a point seen from these angles, in degrees, in a field of view of 60.
fn seen([x, y, z]: [f64; 3], azimuth: f64, elevation: f64) -> [f64; 3] {
    let [(sin_a, cos_a), (sin_e, cos_e)] =
        [azimuth, elevation].map(|angle| angle.to_radians().sin_cos());
    // The camera is at -z for azimuth 0, at +x for 90.
    let right = -x * cos_a - z * sin_a;
    let ground = x * sin_a - z * cos_a;
    let (up, depth) = (y * cos_e - ground * sin_e, DISTANCE - y * sin_e - ground * cos_e);
    let scale = (SIZE * SAMPLES) as f64 / 2.0;
    let focal = 1.0 / 30f64.to_radians().tan();
    [scale * (1.0 + focal * right / depth), scale * (1.0 - focal * up / depth), depth]
}

/// The picture at (u, v), interpolated between the centres of its texels.
fn sampled(picture: &RgbImage, [u, v]: [f64; 2]) -> [f64; 3] {
    let (width, height) = picture.dimensions();
    let (x, y) = (u * f64::from(width) - 0.5, (1.0 - v) * f64::from(height) - 0.5);
    let mut sum = [0.0; 3];
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let [column, row] = [x.floor() + f64::from(dx), y.floor() + f64::from(dy)];
        let share = (1.0 - (x - column).abs()) * (1.0 - (y - row).abs());
        let at = [(column, width), (row, height)]
            .map(|(k, count)| (k as i64).rem_euclid(i64::from(count)) as u32);
        let texel = picture.get_pixel(at[0], at[1]).0;
        (0..3).for_each(|k| sum[k] += share * f64::from(texel[k]));
    }
    sum
}

/// Draws the nearest face at each sample, on white: means of red, green, blue and coverage over the samples of each pixel.
fn drawn(mesh: &Mesh, picture: &RgbImage, azimuth: f64, elevation: f64) -> Vec<[f64; 4]> {
    let texture = mesh.texture().unwrap();
    let across = SIZE * SAMPLES;
    let mut samples = vec![(f64::INFINITY, [255.0; 3]); across * across];
    let side = |a: [f64; 3], b: [f64; 3], x: f64, y: f64| {
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
    };
    for (triangle, entries) in mesh.triangles().zip(texture.corners()) {
        let [a, b, c] = triangle.map(|p| seen(p, azimuth, elevation));
        let uvs = entries.map(|entry| texture.coordinates()[entry as usize]);
        let area = side(a, b, c[0], c[1]);
        let range = |k: usize| {
            let [p, q, r] = [a[k], b[k], c[k]];
            p.min(q).min(r) as usize..(p.max(q).max(r) as usize + 1).min(across)
        };
        for (row, column) in range(1).flat_map(|y| range(0).map(move |x| (y, x))) {
            let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
            let shares = [side(b, c, x, y), side(c, a, x, y), side(a, b, x, y)].map(|s| s / area);
            if !shares.iter().all(|&share| share >= 0.0) {
                continue;
            }
            // On the screen 1 / z is linear, and so is u / z.
            let closeness = [(a, 0), (b, 1), (c, 2)].map(|(p, k)| shares[k] / p[2]);
            let depth = 1.0 / closeness.iter().sum::<f64>();
            let sample = &mut samples[row * across + column];
            if depth < sample.0 {
                let uv = [0, 1].map(|k| (0..3).map(|i| closeness[i] * uvs[i][k]).sum::<f64>());
                *sample = (depth, sampled(picture, uv.map(|x| x * depth)));
            }
        }
    }
    let part = 1.0 / (SAMPLES * SAMPLES) as f64;
    let mut pixels = vec![[0.0; 4]; SIZE * SIZE];
    for (k, (depth, [r, g, b])) in samples.into_iter().enumerate() {
        let pixel = &mut pixels[k / across / SAMPLES * SIZE + k % across / SAMPLES];
        let covered = f64::from(u8::from(depth.is_finite()));
        for (mean, value) in pixel.iter_mut().zip([r, g, b, covered]) {
            *mean += part * value;
        }
    }
    pixels
}

#[test]
fn a_textured_mesh_looks_as_a_plain_rasterizer_draws_it() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/meshes/fox.glb");
    let (mesh, _) = Mesh::load_textured(&file).unwrap();
    let picture = mesh.texture().unwrap().picture().unwrap();
    let picture = image::load_from_memory(picture).unwrap().into_rgb8();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("fox.png");
    for (azimuth, elevation) in [(30.0, 20.0), (200.0, -10.0)] {
        let [size, azimuths, elevations] =
            [SIZE.to_string(), format!("{azimuth}"), format!("{elevation}")];
        let words = ["--colour", "--distance", "2.5", "--repeat", "1", "--size", &size];
        let mut render = Command::new(env!("CARGO_BIN_EXE_render"));
        render.arg(&file).args(words).args(["--azimuths", &azimuths, "--elevation", &elevations]);
        assert!(render.arg("--out").arg(&out).output().unwrap().status.success());
        let found = image::open(&out).unwrap().into_rgb8();
        let expected = drawn(&mesh.normalized(), &picture, azimuth, elevation);
        let psnr = |counts: &dyn Fn(f64) -> bool| {
            let pairs = found.pixels().zip(&expected).filter(|(_, pixel)| counts(pixel[3]));
            let errors: Vec<f64> = pairs
                .flat_map(|(found, pixel)| [0, 1, 2].map(|k| f64::from(found.0[k]) - pixel[k]))
                .map(|error| (error / 255.0).powi(2))
                .collect();
            assert!(errors.len() > 500, "the fox is seen");
            -10.0 * (errors.iter().sum::<f64>() / errors.len() as f64).log10()
        };
        // Soft edges widen the outline by about a tenth of a sample.
        let [inside, outline] =
            [psnr(&|share| share == 1.0), psnr(&|share| share > 0.0 && share < 1.0)];
        println!("{inside:.1} dB where pixels are covered in full, {outline:.1} dB at the outline");
        assert!(inside > 55.0 && outline > 27.0, "from {azimuth}, {elevation}");
    }
}
