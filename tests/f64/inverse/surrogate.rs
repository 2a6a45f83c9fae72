//! A surrogate: the image of one softness with the gradient of another.

use std::sync::Arc;

use softrast_inverse::{
    PhiLayout, Resolution, ScaleSchedule, ScheduledRenderer, ScheduledSoftness, Surrogate,
};
use softrast_raster::{
    Projected, SoftRenderer,
    low_level::{Rasterizer, Silhouette},
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, tensor, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;

const SIZE: usize = 16;
/// Two overlapping triangles.
const CORNERS: [f64; 18] = [
    -0.6, -0.5, 1.0, 0.7, -0.4, 1.0, 0.1, 0.6, 1.0, -0.2, -0.7, 1.0, 0.8, 0.2, 1.0, -0.3, 0.5, 1.0,
];

const LOGISTIC: EdgeSoftness = EdgeSoftness::new(Family::Logistic);

fn faces() -> Arc<[[u32; 3]]> {
    Arc::new([[0, 1, 2], [3, 4, 5]])
}

fn weights() -> Tensor<A, 3> {
    let weights: Vec<f64> = (0..SIZE * SIZE).map(|i| (0.37 * i as f64).sin()).collect();
    tensor(&weights, [1, SIZE, SIZE])
}

/// The gradient of a sum of pixels with respect to the corners.
fn gradient(sum: impl Fn(Tensor<A, 3>) -> Tensor<A, 1>) -> Vec<f64> {
    let corners = vector::<A>(&CORNERS).require_grad();
    let grads = sum(corners.clone().reshape([1, 6, 3])).backward();
    numbers(corners.grad(&grads).unwrap())
}

fn narrow() -> ScheduledSoftness {
    ScheduledSoftness::constant(LOGISTIC, 0.01)
}

fn both() -> ScheduledSoftness {
    narrow().with_surrogate_scale(0.1)
}

/// The renderer of a run of three steps.
fn renderer(softness: ScheduledSoftness) -> ScheduledRenderer {
    let layout = PhiLayout::new(softness, Vec::new(), 3, SIZE);
    let phi = layout.start();
    let (rasterizer, faces) = (Rasterizer::new(SIZE), Some(faces()));
    ScheduledRenderer::new(layout, &phi, rasterizer, Resolution::Full, faces)
}

fn image_at(renderer: &ScheduledRenderer, step: usize) -> Vec<f64> {
    numbers(renderer.at::<B>(step).silhouette(Projected::new(tensor(&CORNERS, [1, 6, 3]))))
}

fn image(softness: ScheduledSoftness) -> Vec<f64> {
    image_at(&renderer(softness), 0)
}

fn gradient_at(renderer: &ScheduledRenderer, step: usize) -> Vec<f64> {
    gradient(|corners| (renderer.at(step).silhouette(Projected::new(corners)) * weights()).sum())
}

#[test]
fn the_image_is_the_narrow_one_to_the_last_bit() {
    assert_eq!(image(both()), image(narrow()));
}

/// `Σ wᵢ dAᵢ/dSᵢ dS'ᵢ/dv`, with A and S of the narrow softness and S' of the wide one: for
/// `A = 1 - exp(-S)` the middle factor is 1 - A.
#[test]
fn the_gradient_is_the_wide_one_through_the_slope_of_the_narrow_image() {
    let found = gradient_at(&renderer(both()), 0);
    let phi = tensor::<B, 1>(&LOGISTIC.default_phi(0.1), [1]);
    let wide: Silhouette<EdgeSoftness> = Rasterizer::new(SIZE).prepare(&faces(), LOGISTIC, &phi);
    let table = Tensor::<A, 2>::from_inner(wide.table(phi));
    let left: Vec<f64> = image(narrow()).iter().map(|a| 1.0 - a).collect();
    let slopes = weights() * tensor(&left, [1, SIZE, SIZE]);
    let expected = gradient(|corners| (wide.sums(corners, table.clone()) * slopes.clone()).sum());
    let narrow = gradient_at(&renderer(narrow()), 0);
    let off = |a: &[f64]| a.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    // The knots of the method's table are chosen in f32, so they may differ.
    assert!(off(&found) < 3e-3 * size, "{found:?}, not {expected:?}");
    assert!(off(&narrow) > 0.1 * size, "{narrow:?} is the gradient of the image itself");
}

#[test]
fn both_move_together() {
    // Halfway the scale is 0.01, and that of the surrogate ten times as large.
    let decay = ScheduledSoftness::decay(LOGISTIC, 0.02, 0.005).with_surrogate_scale(0.2);
    let moving = renderer(decay);
    let (found, expected) = (gradient_at(&moving, 1), gradient_at(&renderer(both()), 0));
    let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    for (a, b) in found.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-5 * size, "{found:?}, not {expected:?}");
    }
    for (a, b) in image_at(&moving, 1).iter().zip(image(narrow())) {
        assert!((a - b).abs() < 1e-12, "{a}, not {b}");
    }
}

#[test]
fn a_renderer_at_a_part_of_a_run_has_both_scales_of_that_part() {
    let schedule = ScaleSchedule { knots: vec![-2.0, -3.0], floor_px: 0.1 };
    let moving = ScheduledSoftness {
        schedule: Some(schedule),
        surrogate: Some(Surrogate { softness: LOGISTIC, phi: LOGISTIC.default_phi(3.0) }),
        ..ScheduledSoftness::constant(LOGISTIC, 1.0)
    };
    for progress in [0.0, 0.3, 1.0] {
        let moved = moving.renderer_at(progress, Rasterizer::new(SIZE), faces());
        let scale = moving.scale_at(progress, SIZE);
        let by_hand = SoftRenderer::new(&faces(), SIZE, LOGISTIC, scale)
            .with_surrogate(LOGISTIC, 3.0 * scale);
        let [found, expected] = [moved, by_hand].map(|renderer| {
            let image =
                numbers(renderer.silhouette(Projected::new(tensor::<B, 3>(&CORNERS, [1, 6, 3]))));
            let pulled = gradient(|corners| {
                (renderer.silhouette(Projected::new(corners)) * weights()).sum()
            });
            [image, pulled].concat()
        });
        for (a, b) in found.into_iter().zip(expected) {
            assert!((a - b).abs() < 1e-4 * (1.0 + b.abs()), "{progress}: {a}, not {b}");
        }
    }
}
