//! A soft silhouette as `PyTorch3D` draws it, from its published formulas in plain numbers, against ours with what
//! docs/guide/coming-from-pytorch3d.md translates.

use burn::{backend::NdArray, tensor::Tensor};
use softrast_mesh::icosphere;
use softrast_raster::{Orbit, SoftRenderer, project, project_from, vertices};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tests::numbers;

type B = NdArray<f64>;
type Point = [f64; 2];

const SIZE: usize = 24;
const SIGMA: f64 = 1e-3;
const FOV_DEG: f64 = 50.0;

/// Rotation and translation of `look_at_view_transform(dist=3, elev=20, azim=35)`: `X_view = X R + T` with row vectors, x left, y up, z in.
fn view() -> ([[f64; 3]; 3], [f64; 3]) {
    let (distance, e, a) = (3.0, 20f64.to_radians(), 35f64.to_radians());
    let eye = [e.cos() * a.sin(), e.sin(), e.cos() * a.cos()].map(|x| distance * x);
    let z = unit(eye.map(|x| -x));
    let x = unit(cross([0.0, 1.0, 0.0], z));
    let y = unit(cross(z, x));
    let r = [0, 1, 2].map(|k| [x[k], y[k], z[k]]);
    let t = [x, y, z].map(|axis| -(0..3).map(|k| axis[k] * eye[k]).sum::<f64>());
    (r, t)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    a.map(|x| x / length)
}

/// Signed squared distance from a pixel to a triangle: negative inside, as in `fragments.dists`.
fn signed_squared_distance(p: Point, corners: [Point; 3]) -> f64 {
    let (mut nearest, mut signs) = (f64::INFINITY, [0.0; 3]);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let [edge, to] = [b, p].map(|q| [q[0] - a[0], q[1] - a[1]]);
        signs[k] = edge[0] * to[1] - edge[1] * to[0];
        let along = (edge[0] * to[0] + edge[1] * to[1]) / (edge[0].powi(2) + edge[1].powi(2));
        let off = [0, 1].map(|i| to[i] - along.clamp(0.0, 1.0) * edge[i]);
        nearest = nearest.min(off[0].powi(2) + off[1].powi(2));
    }
    let inside = signs.iter().all(|&s| s > 0.0) || signs.iter().all(|&s| s < 0.0);
    if inside { -nearest } else { nearest }
}

#[test]
fn a_silhouette_with_the_translated_scale_and_camera_is_that_of_pytorch3d() {
    let mesh = icosphere(1);
    let positions: Vec<[f64; 3]> = mesh
        .positions()
        .iter()
        .map(|&[x, y, z]| [x + 0.3 * y, 0.6 * y, 0.8 * z - 0.2 * x])
        .collect();
    let (r, t) = view();
    let focal = (FOV_DEG / 2.0).to_radians().tan().recip();

    // Theirs: NDC with x left, the first column at x = 1, the first row at y = 1.
    let seen: Vec<Point> = positions
        .iter()
        .map(|p| {
            let camera = [0, 1, 2].map(|j| (0..3).map(|i| p[i] * r[i][j]).sum::<f64>() + t[j]);
            [0, 1].map(|k| focal * camera[k] / camera[2])
        })
        .collect();
    let theirs: Vec<f64> = (0..SIZE * SIZE)
        .map(|pixel| {
            let place = |index: usize| 1.0 - (2 * index + 1) as f64 / SIZE as f64;
            let p = [place(pixel % SIZE), place(pixel / SIZE)];
            let transparent = mesh.faces().iter().map(|face| {
                let distance = signed_squared_distance(p, face.map(|v| seen[v as usize]));
                1.0 - 1.0 / (1.0 + (distance / SIGMA).exp())
            });
            1.0 - transparent.product::<f64>()
        })
        .collect();

    // Ours: x is right, so the first row of rotation and translation changes sign.
    let rows = [-1.0, 1.0, 1.0];
    let rotation: Vec<f64> = (0..9).map(|k| rows[k / 3] * r[k % 3][k / 3]).collect();
    let translation: Vec<f64> = (0..3).map(|k| rows[k] * t[k]).collect();
    let device = Default::default();
    let row = |values: &[f64]| Tensor::<B, 1>::from_data(values, &device);
    let seen = project_from(
        vertices::<B>(&positions, &device),
        row(&rotation).reshape([1, 3, 3]),
        row(&translation).reshape([1, 3]),
        row(&[FOV_DEG]),
    );
    let softness = EdgeSoftness { family: Family::Logistic, squared: true };
    let renderer = SoftRenderer::new(mesh.faces(), SIZE, softness, SIGMA);
    let ours = numbers(renderer.silhouette(seen));
    // Our own orbit shows the mirror image.
    let orbit =
        Orbit { distance: 3.0, elevation_deg: 20.0, azimuth_deg: 180.0 - 35.0, fov_deg: FOV_DEG };
    let seen = project(vertices::<B>(&positions, &device), orbit.tensor(&device));
    let mirrored = numbers(renderer.silhouette(seen).flip([2]));
    for (pixel, theirs) in theirs.iter().enumerate() {
        for ours in [ours[pixel], mirrored[pixel]] {
            assert!((ours - theirs).abs() < 1e-5, "pixel {pixel}: {ours}, not {theirs}");
        }
    }
    let covered = theirs.iter().sum::<f64>() / (SIZE * SIZE) as f64;
    assert!((0.1..0.9).contains(&covered), "{covered}");
}
