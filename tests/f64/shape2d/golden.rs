//! Values before any step.
//!
//! Source: this test and [`shape2d`]'s own logos; a change of them is a change of the task.

use shape2d::{Instance, Logo, Scene};
use softrast_cli::Variant;
use softrast_tensor::{NdArray, Tensor};

type B = NdArray<f64>;

const SIZE: usize = 256;
const TOLERANCE: f64 = 5e-4;

fn assert_close(what: &str, found: f64, expected: f64) {
    let off = (found / expected - 1.0).abs();
    assert!(off < TOLERANCE, "{what}: {found}, expected {expected}, off by {off:.1e}");
}

/// Hard mean squared errors, original and transfer.
const MSE: [f64; 2] = [0.4463, 0.4694];
/// `0.03 / 2.155² · 2.25 · 3 r²` for each triangle, whose areas `3 √3 r² / 4` add up to 2.
const SMOOTHNESS: f64 = 0.067_133;

#[test]
fn triangles_start_as_far_from_the_logos_as_ever() {
    for (variant, triangles, mse) in
        [(Variant::Original, 800, MSE[0]), (Variant::Transfer, 4000, MSE[1])]
    {
        let instance = Instance::seeded(0, triangles, 1);
        let scene = Scene::<B>::new(&Logo::of(variant).image(SIZE), &instance, SIZE);
        let hard = scene.image_loss(scene.hard(scene.vertices(scene.start())));
        let smoothness = scene.smoothness_loss(scene.start());
        let [hard, smoothness] =
            [hard, smoothness].map(|tensor: Tensor<B, 1>| tensor.into_scalar());
        assert_close(&format!("hard MSE {variant:?}"), hard, mse);
        assert_close(&format!("smoothness {variant:?}"), smoothness, SMOOTHNESS);
    }
}
