//! A surrogate: the image of one softness with the gradient of another.

use std::sync::Arc;

use burn::{
    backend::{Autodiff, NdArray},
    tensor::Tensor,
};
use clap::Parser;
use softrast_method::{Defaults, Method, MovingSilhouette};
use softrast_raster::{BackendChoice, Rasterizer, Silhouette};
use softrast_runner::{Schedule, Settings};
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tests::{numbers, tensor, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;

const SIZE: usize = 16;
/// Two triangles that overlap.
const CORNERS: [f64; 18] = [
    -0.6, -0.5, 1.0, 0.7, -0.4, 1.0, 0.1, 0.6, 1.0, -0.2, -0.7, 1.0, 0.8, 0.2, 1.0, -0.3, 0.5, 1.0,
];

fn method(line: &str) -> Method {
    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: Settings,
    }
    let defaults = Defaults {
        task: "none",
        schedule: Schedule::Static,
        decay: [0.1; 2],
        fixed: 0.1,
        size: SIZE,
        backends: &[BackendChoice::NdArray],
    };
    let words = ["task"].into_iter().chain(line.split_whitespace());
    Method::new(&Line::parse_from(words).settings, &defaults).unwrap()
}

fn faces() -> Arc<[[u32; 3]]> {
    Arc::new([[0, 1, 2], [3, 4, 5]])
}

fn weights() -> Tensor<A, 3> {
    let weights: Vec<f64> = (0..SIZE * SIZE).map(|i| (0.37 * i as f64).sin()).collect();
    tensor(&weights, [1, SIZE, SIZE])
}

/// The gradient of a sum of pixels to the corners.
fn gradient(sum: impl Fn(Tensor<A, 3>) -> Tensor<A, 1>) -> Vec<f64> {
    let corners = vector::<A>(&CORNERS).require_grad();
    let grads = sum(corners.clone().reshape([1, 6, 3])).backward();
    numbers(corners.grad(&grads).unwrap())
}

fn silhouette(line: &str) -> MovingSilhouette<A> {
    MovingSilhouette::new(&method(line), Rasterizer::new(SIZE), &faces(), 0.01)
}

fn image(line: &str) -> Vec<f64> {
    numbers(silhouette(line).image(tensor(&CORNERS, [1, 6, 3])))
}

const NARROW: &str = "--softness logistic --scale 0.01";
const BOTH: &str = "--softness logistic --scale 0.01 --surrogate-scale 0.1";

#[test]
fn the_image_is_the_narrow_one_to_the_last_bit() {
    assert_eq!(image(BOTH), image(NARROW));
}

/// `Σ wᵢ dAᵢ/dSᵢ dS'ᵢ/dv`, with A and S of the narrow softness and S' of the wide one: for
/// `A = 1 - exp(-S)` the middle factor is 1 - A.
#[test]
fn the_gradient_is_the_wide_one_through_the_slope_of_the_narrow_image() {
    let found = gradient(|corners| (silhouette(BOTH).image(corners) * weights()).sum());
    let wide = method("--softness logistic --scale 0.1");
    let phi = tensor::<B, 1>(&wide.phi(0.1), [1]);
    let felt: Silhouette<EdgeSoftness> =
        Rasterizer::new(SIZE).prepare(&faces(), wide.softness(), &phi);
    assert_eq!(wide.softness().parameters(), 1);
    let table = Tensor::<A, 2>::from_inner(felt.table(phi));
    let left: Vec<f64> = image(NARROW).iter().map(|a| 1.0 - a).collect();
    let slopes = weights() * tensor(&left, [1, SIZE, SIZE]);
    let expected = gradient(|corners| (felt.sums(corners, table.clone()) * slopes.clone()).sum());
    let narrow = gradient(|corners| (silhouette(NARROW).image(corners) * weights()).sum());
    let off = |a: &[f64]| a.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    // The table of the method is chosen in f32, so its knots may be others.
    assert!(off(&found) < 3e-3 * size, "{found:?}, not {expected:?}");
    assert!(off(&narrow) > 0.1 * size, "{narrow:?} is the gradient of the image itself");
}

#[test]
fn both_move_together() {
    let line =
        "--softness logistic --schedule decay --scale 0.02 --scale-end 0.005 --surrogate-scale 0.2";
    let mut moving: MovingSilhouette<A> =
        MovingSilhouette::new(&method(line), Rasterizer::new(SIZE), &faces(), 0.02);
    moving.turn_to(0.01);
    let of = |silhouette: &MovingSilhouette<A>| {
        gradient(|corners| (silhouette.image(corners) * weights()).sum())
    };
    let (found, expected) = (of(&moving), of(&silhouette(BOTH)));
    let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    for (a, b) in found.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-5 * size, "{found:?}, not {expected:?}");
    }
    assert_eq!(numbers(moving.image(tensor(&CORNERS, [1, 6, 3]))), image(NARROW));
}
