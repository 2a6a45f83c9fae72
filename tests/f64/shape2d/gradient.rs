//! Derivatives of the loss compared with central differences, in f64.

use shape2d::{Instance, Logo, Scene};
use softrast_cli::Variant;
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

const SIZE: usize = 16;
const TRIANGLES: usize = 12;
const SOFTNESS: EdgeSoftness = EdgeSoftness::new(Family::Logistic);
const SCALE: f64 = 0.08;
/// The whole loss of a few triangles relative to the letters.
struct Small {
    silhouette: Silhouette<EdgeSoftness>,
}

impl Small {
    fn new() -> Self {
        let rasterizer = Rasterizer { tolerance: 1e-10, ..Rasterizer::new(SIZE) };
        let near = vector::<B>(&SOFTNESS.default_phi(SCALE));
        let faces = (0..TRIANGLES as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        Self { silhouette: rasterizer.prepare(&faces, SOFTNESS, &near) }
    }
}

impl<B: RasterBackend> Objective<B> for Small {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let instance = Instance::seeded(1, TRIANGLES, 1);
        let scene = Scene::<B>::new(&Logo::of(Variant::Original).image(SIZE), &instance, SIZE);
        let image = self.silhouette.coverage(scene.vertices(theta.clone()).tensor(), phi);
        scene.image_loss(image) + scene.smoothness_loss(theta)
    }
}

fn theta() -> Vec<f64> {
    Instance::seeded(1, TRIANGLES, 1).corners.concat()
}

#[test]
fn the_gradient_matches_central_differences() {
    check_gradient(&Small::new(), &theta(), &SOFTNESS.default_phi(SCALE));
}

#[test]
fn the_meta_gradient_through_two_steps_matches_central_differences() {
    check_meta_gradient(&Small::new(), 0.01, &theta(), SOFTNESS.default_phi(SCALE)[0]);
}
