//! A soft silhouette of `PyTorch3D`, computed from its published formulas, compared with ours after the translation in
//! docs/guide/coming-from-pytorch3d.md.
//!
//! Source: Liu et al. 2019, Eq. 1 and its aggregate function for silhouettes, as in `sigmoid_alpha_blend` of `PyTorch3D`.

use softrast_mesh::{Mesh, icosphere};
use softrast_raster::{
    Orbit, Pinhole, Pinholes, Projected, PyTorch3dCamera, SoftRenderer, project, vertex_tensor,
};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::{NdArray, Tensor};
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

/// A ball that is compressed and sheared, so that no two of its sides look the same.
fn mesh() -> Mesh {
    let ball = icosphere(1);
    let sheared =
        ball.positions().iter().map(|[x, y, z]| [x + 0.3 * y, 0.6 * y, 0.8 * z - 0.2 * x]);
    Mesh::new(sheared.collect(), ball.faces().to_vec()).unwrap()
}

fn focal() -> f64 {
    (FOV_DEG / 2.0).to_radians().tan().recip()
}

/// The vertices in the axes of their camera: left, up, ahead.
fn seen(mesh: &Mesh) -> Vec<[f64; 3]> {
    let (r, t) = view();
    let along = |p: &[f64; 3], j: usize| (0..3).map(|i| p[i] * r[i][j]).sum::<f64>() + t[j];
    mesh.positions().iter().map(|p| [0, 1, 2].map(|j| along(p, j))).collect()
}

/// `1 - Π (1 - sigmoid(-dists / sigma))` of each pixel, over the faces within `blur_radius`. PyTorch3D's NDC has x left: the first column
/// is at x = 1, the first row at y = 1.
fn theirs(mesh: &Mesh, blur_radius: f64) -> Vec<f64> {
    let seen: Vec<Point> =
        seen(mesh).iter().map(|p| [0, 1].map(|k| focal() * p[k] / p[2])).collect();
    let place = |index: usize| 1.0 - (2 * index + 1) as f64 / SIZE as f64;
    let alpha = |pixel: usize| {
        let p = [place(pixel % SIZE), place(pixel / SIZE)];
        let corners = mesh.faces().iter().map(|face| face.map(|v| seen[v as usize]));
        let distances = corners.map(|corners| signed_squared_distance(p, corners));
        let near = distances.filter(|&distance| distance < blur_radius);
        1.0 - near.map(|distance| 1.0 - 1.0 / (1.0 + (distance / SIGMA).exp())).product::<f64>()
    };
    (0..SIZE * SIZE).map(alpha).collect()
}

/// Our silhouette of projected vertices, with `sigma` as the scale.
fn ours(mesh: &Mesh, seen: Tensor<B, 3>) -> Vec<f64> {
    let softness = EdgeSoftness::squared(Family::Logistic);
    let image =
        SoftRenderer::new(mesh.faces(), SIZE, softness, SIGMA).silhouette(Projected::new(seen));
    numbers(image)
}

fn assert_same(ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len());
    for (pixel, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
        assert!((ours - theirs).abs() < 1e-5, "pixel {pixel}: {ours}, not {theirs}");
    }
}

#[test]
fn a_silhouette_with_the_translated_scale_and_camera_is_that_of_pytorch3d() {
    let mesh = mesh();
    let theirs = theirs(&mesh, f64::INFINITY);
    let covered = theirs.iter().sum::<f64>() / (SIZE * SIZE) as f64;
    assert!((0.1..0.9).contains(&covered), "{covered}");

    let ((r, t), device) = (view(), Default::default());
    let (focal_length, principal_point) = ([focal(); 2], [0.0; 2]);
    let camera = PyTorch3dCamera { r, t, focal_length, principal_point };
    let camera = Pinhole::from_pytorch3d(&camera, SIZE);
    let corners = vertex_tensor::<B>(mesh.positions(), &device);
    let seen = project(corners, Pinholes::new(&[camera], &device));
    assert_same(&ours(&mesh, seen.tensor()), &theirs);
}

#[test]
fn an_orbit_shows_the_same() {
    let mesh = mesh();
    let azimuth_deg = 180.0 - 35.0;
    let orbit = Orbit { distance: 3.0, elevation_deg: 20.0, azimuth_deg, fov_deg: FOV_DEG };
    let device = Default::default();
    let seen = project(vertex_tensor::<B>(mesh.positions(), &device), orbit.tensor(&device));
    assert_same(&ours(&mesh, seen.tensor()), &theirs(&mesh, f64::INFINITY));
}

#[test]
fn clip_space_of_opengl_over_its_w_is_what_we_draw() {
    let mesh = mesh();
    // PyTorch3D's left is reversed in OpenGL; w is the depth ahead.
    let clip = seen(&mesh).into_iter().map(|[x, y, z]| [-focal() * x, focal() * y, z]);
    let over_w: Vec<[f64; 3]> = clip.map(|[x, y, w]| [x / w, y / w, w]).collect();
    let image = ours(&mesh, vertex_tensor::<B>(&over_w, &Default::default()));
    assert_same(&image, &theirs(&mesh, f64::INFINITY));
}

/// The claim of the page about PyTorch3D's usual cut: a face covers 1e-4 there.
#[test]
fn the_usual_blur_radius_leaves_out_more_than_our_tolerance() {
    let mesh = mesh();
    let cut = theirs(&mesh, (1.0 / 1e-4_f64 - 1.0).ln() * SIGMA);
    let all = theirs(&mesh, f64::INFINITY);
    let most = all.iter().zip(&cut).map(|(all, cut)| all - cut).fold(0.0, f64::max);
    assert!((1e-4..1e-3).contains(&most), "{most}");
}
