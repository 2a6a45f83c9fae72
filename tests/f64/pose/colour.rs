//! POSE with colour: the gradient of the loss compared with central differences.

use pose::colour::Scene;
use softrast_inverse::{PoseProblem, pose::PoseInstance};
use softrast_mesh::painted_fox;
use softrast_meta::Objective;
use softrast_raster::{RasterBackend, low_level::Rasterizer};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::numbers;

use crate::differences::check_gradient_to;

const SIZE: usize = 24;
const SOFTNESS: EdgeSoftness = EdgeSoftness::new(Family::Logistic);

/// Three cameras around the coloured fox, whose fields of view are optimised too.
struct Three;

fn scene<B: RasterBackend>() -> Scene<B> {
    let instances = [0, 1, 2].map(|seed| PoseInstance::seeded(seed, [15.0, 35.0]));
    let fox = painted_fox();
    let problem = PoseProblem { optimise_fov: true, ..PoseProblem::new(&fox) };
    Scene::new(&problem, fox.colours().unwrap(), &instances, SIZE)
}

impl<B: RasterBackend> Objective<B> for Three {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let rasterizer = Rasterizer { tolerance: 1e-9, ..Rasterizer::new(SIZE) };
        let silhouette = rasterizer.prepare(&painted_fox().faces().into(), SOFTNESS, &phi);
        let scene = scene::<B>();
        let image = scene.image_with(theta, |seen| silhouette.coverage(seen.tensor(), phi.clone()));
        scene.image_loss(image).sum()
    }
}

#[test]
fn the_gradient_to_the_pose_matches_central_differences() {
    let start = scene::<NdArray<f64>>().silhouettes().start();
    // Edges are a fifth of a pixel wide, so slopes change within the step of a difference.
    check_gradient_to(1e-5, &Three, &numbers(start), &SOFTNESS.default_phi(0.05));
}
