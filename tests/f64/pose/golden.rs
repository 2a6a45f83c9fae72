//! The 24 released pairs on spot compared with recorded values, to 5e-4.
//!
//! Source: docs/notes.md, Regression values. The mesh is third-party and not part of this repository.

use pose::{PoseError, released24};
use softrast_inverse::{
    PoseProblem,
    pose::{PoseInstance, PoseScene},
};
use softrast_raster::{iou_loss, low_level::Rasterizer};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::{paper_mesh, vector};

type B = NdArray<f64>;

const SIZE: usize = 64;
const TOLERANCE: f64 = 5e-4;

fn assert_close(what: &str, found: f64, expected: f64, tolerance: f64) {
    let off = (found / expected - 1.0).abs();
    assert!(off < tolerance, "{what}: {found}, expected {expected}, off by {off:.1e}");
}

fn sum(losses: Tensor<B, 1>) -> f64 {
    losses.into_data().iter::<f64>().sum()
}

#[test]
#[ignore = "needs the paper's meshes"]
fn targets_and_losses_before_any_step_are_those_measured_before() {
    let mesh = paper_mesh("spot.obj");
    let instances = released24().unwrap();
    let scene = PoseScene::<B>::new(&PoseProblem::new(&mesh), &instances, SIZE);
    let target = scene.target();
    let coverage: f64 = target.clone().mean().into_scalar();
    assert_close("coverage of the targets", coverage, 0.25180, TOLERANCE);

    let projected = scene.project(scene.start());
    let hard = sum(iou_loss(scene.hard(projected.clone()), target.clone()));
    assert_close("hard loss", hard, 16.5601, TOLERANCE);

    let released = instances.iter().map(|PoseInstance { target, start }| {
        let pose = [start.distance, start.elevation_deg, start.azimuth_deg];
        PoseError::new(pose, target.distance).released()
    });
    assert_close("parameter error", released.sum(), 1.64015, 1e-5);

    for (family, scale, expected) in [
        (Family::Gauss, 1e-2, 15.648),
        (Family::Gauss, 10f64.powf(-2.5), 16.431),
        (Family::Gamma, 0.1, 14.617),
        (Family::Gamma, 1e-2, 15.084),
    ] {
        let softness = EdgeSoftness::new(family);
        let phi = vector::<B>(&softness.default_phi(scale));
        let silhouette = Rasterizer::new(SIZE).prepare(&mesh.faces().into(), softness, &phi);
        let image = silhouette.coverage(projected.clone().tensor(), phi);
        let loss = sum(iou_loss(image, target.clone()));
        assert_close(&format!("{family} {scale}"), loss, expected, TOLERANCE);
    }
}
