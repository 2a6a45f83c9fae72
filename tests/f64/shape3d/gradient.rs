//! Derivatives of the loss compared with central differences, in f64.

use shape3d::{Instance, Scene};
use softrast_mesh::{airplane, icosphere};
use softrast_meta::Objective;
use softrast_raster::{
    RasterBackend,
    low_level::{Rasterizer, Silhouette},
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::vector;

use crate::differences::{check_gradient, check_meta_gradient};

type B = NdArray<f64>;

const SIZE: usize = 12;
const SOFTNESS: EdgeSoftness = EdgeSoftness::new(Family::Logistic);
const SCALE: f64 = 0.05;
/// The whole loss of a small sphere relative to the airplane.
struct Small {
    silhouette: Silhouette<EdgeSoftness>,
}

impl Small {
    fn new() -> Self {
        let rasterizer = Rasterizer { tolerance: 1e-10, ..Rasterizer::new(SIZE) };
        let near = vector::<B>(&SOFTNESS.default_phi(SCALE));
        Self { silhouette: rasterizer.prepare(&icosphere(0).faces().into(), SOFTNESS, &near) }
    }
}

impl<B: RasterBackend> Objective<B> for Small {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let instance = Instance { elevation_deg: 30.0, turn: 3 };
        let scene = Scene::<B>::new(&airplane(), &icosphere(0), &instance, SIZE);
        let vertices = scene.vertices(theta);
        let image = self.silhouette.coverage(scene.project(vertices.clone()).tensor(), phi);
        scene.image_loss(image) + scene.smoothness_loss(vertices)
    }
}

/// Parameters without symmetry: `[3 * 12 + 3]`.
fn theta() -> Vec<f64> {
    (0..39).map(|k| 0.3 * (1.7 * f64::from(k)).sin()).collect()
}

#[test]
fn the_gradient_matches_central_differences() {
    check_gradient(&Small::new(), &theta(), &SOFTNESS.default_phi(SCALE));
}

#[test]
fn the_meta_gradient_through_two_steps_matches_central_differences() {
    check_meta_gradient(&Small::new(), 0.03, &theta(), SOFTNESS.default_phi(SCALE)[0]);
}
