//! The gradient of the loss with respect to the pose compared with central differences, in f64.

use softrast_inverse::{
    PoseProblem,
    pose::{PoseInstance, PoseScene},
};
use softrast_mesh::fox;
use softrast_raster::{
    iou_loss,
    low_level::{Rasterizer, Silhouette},
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, tensor, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;

const VIEWS: usize = 3;
const SIZE: usize = 24;
/// Step of the differences, in world units and degrees alike.
const H: f64 = 1e-5;

fn losses(
    scene: &PoseScene<A>,
    silhouette: &Silhouette<EdgeSoftness>,
    theta: Tensor<A, 2>,
) -> Tensor<A, 1> {
    let phi = EdgeSoftness::new(Family::Logistic).default_phi(0.05);
    let image = silhouette.coverage(scene.project(theta).tensor(), vector(&phi));
    iou_loss(image, scene.target())
}

/// Compares all entries of θ `[views, columns]`, whose last column is the field of view if there are four.
fn check(optimise_fov: bool) {
    let instances = [0, 1, 2].map(|seed| PoseInstance::seeded(seed, [15.0, 35.0]));
    let problem = PoseProblem { optimise_fov, ..PoseProblem::new(&fox()) };
    let scene = PoseScene::<A>::new(&problem, &instances, SIZE);
    let softness = EdgeSoftness::new(Family::Logistic);
    let phi = vector::<A>(&softness.default_phi(0.05));
    let rasterizer = Rasterizer { tolerance: 1e-9, ..Rasterizer::new(SIZE) };
    let silhouette = rasterizer.prepare(&fox().faces().into(), softness, &phi);

    let theta = scene.start().require_grad();
    let columns = theta.dims()[1];
    let grads = losses(&scene, &silhouette, theta.clone()).sum().backward();
    let grad = numbers(theta.grad(&grads).unwrap());
    let start = numbers(theta);
    let largest = grad.iter().fold(0.0, |largest: f64, g| largest.max(g.abs()));
    for (k, &grad) in grad.iter().enumerate() {
        let at = |h: f64| -> Vec<f64> {
            let mut moved = start.clone();
            moved[k] += h;
            let theta = tensor(&moved, [VIEWS, columns]);
            numbers(losses(&scene, &silhouette, theta))
        };
        let (after, before) = (at(H), at(-H));
        let slopes: Vec<f64> =
            after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * H)).collect();
        for (view, slope) in slopes.into_iter().enumerate() {
            // Views are independent.
            let expected = if view == k / columns { grad } else { 0.0 };
            let off = (slope - expected).abs() / largest;
            assert!(off < 1e-6, "entry {k}, view {view}: {slope} and {expected}, off by {off:.1e}");
        }
    }
}

#[test]
fn the_pose_gradient_matches_central_differences() {
    check(false);
}

#[test]
fn so_does_the_gradient_to_the_field_of_view() {
    check(true);
}
