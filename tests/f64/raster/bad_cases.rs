//! Degenerate scenes: every number stays finite, and known exact results are met.

use std::sync::{Arc, LazyLock};

use softrast_raster::{
    NEAR, TConorm,
    low_level::{Rasterizer, Silhouette},
    reference,
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray};
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;

const SIZE: usize = 16;

/// Silhouettes of one face, for every family at each of [`SCALES`]: choosing knots costs far more than an image.
static OF_ONE_FACE: LazyLock<Vec<Silhouette<EdgeSoftness>>> =
    LazyLock::new(|| prepared(1).collect());

const SCALES: [f64; 4] = [1e-12, 1e-3, 0.1, 1e3];

fn cases() -> impl Iterator<Item = (EdgeSoftness, f64)> {
    let edges = Family::ALL.into_iter().map(EdgeSoftness::new);
    edges.flat_map(|edge| SCALES.map(|scale| (edge, scale)))
}

fn prepared(faces: u32) -> impl Iterator<Item = Silhouette<EdgeSoftness>> {
    cases().map(move |(softness, scale)| prepare(faces, softness, scale))
}

fn loose(count: u32) -> Arc<[[u32; 3]]> {
    (0..count).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect()
}

fn prepare(faces: u32, softness: EdgeSoftness, scale: f64) -> Silhouette<EdgeSoftness> {
    let phi = vector::<B>(&softness.default_phi(scale));
    Rasterizer::new(SIZE).prepare(&loose(faces), softness, &phi)
}

/// Coverage and gradient of `Σ coverage²` with respect to the vertices, by the fused op.
fn render(
    corners: &[[f64; 3]],
    silhouette: &Silhouette<EdgeSoftness>,
    softness: EdgeSoftness,
    scale: f64,
) -> (Vec<f64>, Vec<f64>) {
    let faces = loose(corners.len() as u32 / 3);
    let vertices = vector::<A>(&corners.concat()).require_grad();
    let phi = vector::<A>(&softness.default_phi(scale)).require_grad();
    let shaped = vertices.clone().reshape([1, corners.len() as i64, 3]);
    let image = silhouette.coverage(shaped.clone(), phi.clone());
    let grads = (image.clone() * image.clone()).sum().backward();
    let scene = reference::Scene { faces: &faces, size: SIZE.into() };
    let sums = reference::sums(scene, shaped, &softness, TConorm::Probabilistic, phi.clone());
    let exact = TConorm::Probabilistic.coverage(sums).inner().reshape([SIZE * SIZE]);
    let image = numbers(image.inner().reshape([SIZE * SIZE]));
    for (pixel, exact) in image.iter().zip(numbers(exact)) {
        assert!((pixel - exact).abs() <= 1e-5, "{pixel} instead of {exact}");
    }
    let grad_phi = numbers(phi.grad(&grads).expect("phi is tracked"));
    assert!(grad_phi.iter().all(|g| g.is_finite()), "gradient to phi {grad_phi:?}");
    (image, numbers(vertices.grad(&grads).expect("vertices are tracked")))
}

fn assert_finite(name: &str, corners: &[[f64; 3]]) -> (Vec<f64>, Vec<f64>) {
    let mut last = Default::default();
    let more: Vec<Silhouette<EdgeSoftness>>;
    let silhouettes = match corners.len() as u32 / 3 {
        1 => &*OF_ONE_FACE,
        faces => {
            more = prepared(faces).collect();
            &more
        }
    };
    for ((softness, scale), silhouette) in cases().zip(silhouettes) {
        let family = softness.family;
        let (image, grad) = render(corners, silhouette, softness, scale);
        let sound = image.iter().all(|a| (0.0..=1.0).contains(a));
        assert!(sound, "{name}, {family} at {scale}: {image:?}");
        assert!(grad.iter().all(|g| g.is_finite()), "{name}, {family} at {scale}: {grad:?}");
        last = (image, grad);
    }
    last
}

#[test]
fn faces_without_area_give_finite_numbers() {
    let p = [0.1, 0.1, 2.0];
    assert_finite("a point", &[p, p, p]);
    assert_finite("two equal corners", &[p, p, [0.3, 0.2, 2.0]]);
    assert_finite("three on a line", &[[-0.5, 0.0, 2.0], [0.0, 0.0, 2.0], [0.5, 0.0, 2.0]]);
}

#[test]
fn slivers_give_finite_numbers() {
    for width in [1e-3, 1e-6, 1e-10, 1e-15] {
        assert_finite("a sliver", &[[-0.7, 0.0, 2.0], [0.7, 0.1, 2.0], [0.7, 0.1 + width, 2.0]]);
    }
}

#[test]
fn pixels_on_edges_and_corners_give_finite_numbers() {
    // Pixel centres are at odd sixteenths.
    let (a, b) = (-7.0 / 16.0, 5.0 / 16.0);
    assert_finite("on pixel centres", &[[a, a, 2.0], [b, a, 2.0], [a, b, 2.0]]);
    let quad = [[a, a, 2.0], [b, a, 2.0], [b, b, 2.0], [a, a, 2.0], [b, b, 2.0], [a, b, 2.0]];
    assert_finite("a shared diagonal", &quad);
}

#[test]
fn hidden_faces_leave_no_trace() {
    let behind = [[-0.5, -0.5, -1.0], [0.5, -0.5, -1.0], [0.0, 0.5, -1.0]];
    let (image, grad) = assert_finite("behind the camera", &behind);
    assert!(image.iter().chain(&grad).all(|&v| v == 0.0));
    let through = [[-0.5, -0.5, 2.0], [0.5, -0.5, NEAR * 0.999], [0.0, 0.5, 2.0]];
    let (image, grad) = assert_finite("through the near plane", &through);
    assert!(image.iter().chain(&grad).all(|&v| v == 0.0));
    let touching = [[-0.5, -0.5, 2.0], [0.5, -0.5, NEAR], [0.0, 0.5, 2.0]];
    let (image, _) = assert_finite("touching the near plane", &touching);
    assert!(image.iter().any(|&v| v > 0.0));
}

#[test]
fn far_and_broken_coordinates_give_finite_numbers() {
    assert_finite("off screen", &[[40.0, 40.0, 2.0], [41.0, 40.0, 2.0], [40.0, 41.0, 2.0]]);
    assert_finite("all around", &[[-1e6, -1e6, 2.0], [1e6, -1e6, 2.0], [0.0, 1e6, 2.0]]);
    let softness = EdgeSoftness::new(Family::Logistic);
    let faces: Arc<[[u32; 3]]> = vec![[0, 1, 2]].into();
    let phi = vector::<B>(&softness.default_phi(0.1));
    for broken in [f64::NAN, f64::INFINITY, 1e300, -1e12] {
        let corners = [broken, 0.0, 2.0, 0.5, 0.0, 2.0, 0.0, 0.5, 2.0];
        let vertices = vector::<B>(&corners).reshape([1, 3, 3]);
        let silhouette = Rasterizer::new(SIZE).prepare(&faces, softness, &phi);
        let image = numbers(silhouette.coverage(vertices, phi.clone()));
        assert!(image.iter().all(|&a| a == 0.0), "a face that is not finite is not drawn");
    }
}

#[test]
fn many_faces_on_a_pixel_add_up_exactly() {
    let face = [[-0.9, -0.9, 2.0], [0.9, -0.9, 2.0], [0.0, 0.9, 2.0]];
    let softness = EdgeSoftness::new(Family::Logistic);
    let (one, _) = render(&face, &prepare(1, softness, 0.3), softness, 0.3);
    let stack: Vec<_> = (0..1000).flat_map(|_| face).collect();
    let (many, _) = render(&stack, &prepare(1000, softness, 0.3), softness, 0.3);
    for (one, many) in one.iter().zip(many) {
        assert!((many - (1.0 - (1.0 - one).powi(1000))).abs() < 1e-5);
    }
}

#[test]
fn a_scene_with_one_pixel_is_drawn() {
    let softness = EdgeSoftness::new(Family::Logistic);
    let faces: Arc<[[u32; 3]]> = vec![[0, 1, 2]].into();
    let phi = vector::<B>(&softness.default_phi(0.1));
    let corners = [-0.5, -0.5, 2.0, 0.5, -0.5, 2.0, 0.0, 0.5, 2.0];
    let vertices = vector::<B>(&corners).reshape([1, 3, 3]);
    let silhouette = Rasterizer::new(1).prepare(&faces, softness, &phi);
    let image = numbers(silhouette.coverage(vertices, phi));
    assert!(image.len() == 1 && image[0] > 0.5);
}
