//! The fused loss of silhouettes is that of the silhouette, and so are its derivatives.

use proptest::prelude::*;
use softrast_raster::{
    Projected, SoftRenderer, iou_loss,
    low_level::{PixelLoss, Silhouette},
    mse_loss,
};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, vector};

use super::triangles::triangles;

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

type Renderer = SoftRenderer<EdgeSoftness>;
/// A loss of vertices, a target, and pixel weights.
type Loss = fn(&Renderer, Tensor<AA, 3>, Tensor<AA, 3>, Option<Tensor<AA, 3>>) -> Tensor<AA, 1>;

/// As one op, and as two.
const LOSSES: [[Loss; 2]; 2] = [
    [
        |renderer, vertices, target, counted| match counted {
            None => renderer.mse_loss(Projected::new(vertices), target),
            Some(_) => {
                let (silhouette, table) = by_table(renderer);
                silhouette.loss_by_table(PixelLoss::SquaredError, vertices, table, target, counted)
            }
        },
        |renderer, vertices, target, counted| mse_loss(part(renderer, vertices, counted), target),
    ],
    [
        |renderer, vertices, target, counted| match counted {
            None => renderer.iou_loss(Projected::new(vertices), target),
            Some(_) => {
                let (silhouette, table) = by_table(renderer);
                silhouette.loss_by_table(PixelLoss::Iou, vertices, table, target, counted)
            }
        },
        |renderer, vertices, target, counted| iou_loss(part(renderer, vertices, counted), target),
    ],
];

fn by_table(renderer: &Renderer) -> (Silhouette<EdgeSoftness>, Tensor<AA, 2>) {
    let silhouette = renderer.prepared::<AA>(renderer.phi());
    let table = silhouette.table(vector(renderer.phi()));
    (silhouette, table)
}

/// A silhouette times pixel weights.
fn part(
    renderer: &Renderer,
    vertices: Tensor<AA, 3>,
    counted: Option<Tensor<AA, 3>>,
) -> Tensor<AA, 3> {
    let silhouette = renderer.silhouette(Projected::new(vertices));
    match counted {
        Some(counted) => silhouette * counted,
        None => silhouette,
    }
}

/// Losses of views, the gradient of a sum of them with respect to the vertices, and the gradients of a product with that with respect to
/// vertices and to the factors of the sum.
fn derivatives(
    loss: Loss,
    renderer: &Renderer,
    [vertices, target]: [Tensor<B, 3>; 2],
    counted: Option<Tensor<B, 3>>,
) -> [Vec<f64>; 4] {
    let views = vertices.dims()[0];
    let wave = |count: usize, step: f64| -> Vec<f64> {
        (0..count).map(|k| (step * (k + 1) as f64).sin()).collect()
    };
    let dims = vertices.dims();
    let direction = vector::<A>(&wave(dims.iter().product(), 1.3)).reshape(dims);
    let inner = Tensor::<A, 3>::from_inner(vertices).require_grad();
    let factors = vector::<A>(&wave(views, 0.7)).require_grad();
    let vertices = Tensor::<AA, 3>::from_inner(inner.clone()).require_grad();
    let constant = |image| Tensor::from_inner(Tensor::from_inner(image));
    let losses = loss(renderer, vertices.clone(), constant(target), counted.map(constant));
    let total = (losses.clone() * Tensor::from_inner(factors.clone())).sum();
    let gradient = vertices.grad(&total.backward()).expect("a gradient");
    let second = (gradient.clone() * direction).sum().backward();
    let to_vertices = inner.grad(&second).expect("a second derivative");
    let to_factors = factors.grad(&second).expect("a gradient to the factors");
    [numbers(losses), numbers(gradient), numbers(to_vertices), numbers(to_factors)]
}

/// Asserts that both implementations agree, for a renderer, `views` views with one target each or one for all, and optional pixel weights.
fn assert_same(
    renderer: &Renderer,
    seed: u64,
    [height, width]: [usize; 2],
    views: usize,
    own: bool,
    weighted: bool,
) {
    let (values, _) = triangles(seed, 20);
    let view = |k: usize| {
        let vertices = vector::<B>(&values).reshape([1, values.len() as i64 / 3, 3]);
        let depth = vertices.clone().narrow(2, 2, 1);
        Tensor::cat(vec![vertices.narrow(2, 0, 2) * (1.0 - 0.1 * k as f64), depth], 2)
    };
    let vertices = Tensor::cat((0..views).map(view).collect(), 0);
    let targets = if own { views } else { 1 };
    let pixel = |k: usize| 0.5 + 0.5 * (0.37 * k as f64).sin();
    let pixels: Vec<f64> = (0..targets * height * width).map(pixel).collect();
    let target = vector::<B>(&pixels).reshape([targets, height, width]);
    // Some pixels have weight 0.
    let share = |k: usize| (1.2 * (0.23 * k as f64).cos()).clamp(0.0, 1.0);
    let shares: Vec<f64> = (0..pixels.len()).map(share).collect();
    let counted = weighted.then(|| vector::<B>(&shares).reshape([targets, height, width]));
    for [one, two] in LOSSES {
        let images = || [vertices.clone(), target.clone()];
        let [found, wanted] =
            [one, two].map(|loss| derivatives(loss, renderer, images(), counted.clone()));
        for (which, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
            let largest = wanted.iter().fold(1e-12, |largest: f64, x| largest.max(x.abs()));
            for (found, wanted) in found.iter().zip(wanted) {
                let off = (found - wanted).abs() / largest;
                assert!(off < 1e-9, "{which}: {found:e} for {wanted:e}, {off:e} of {largest:e}");
            }
        }
    }
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(40))]

    #[test]
    fn one_op_gives_what_two_give(
        seed in 0u64..1000,
        family in proptest::sample::select(Family::ALL.to_vec()),
        squared: bool,
        width in -2.0f64..-0.5,
        size in proptest::sample::select(vec![[9, 9], [70, 13], [13, 70]]),
        views in 1usize..6,
        own: bool,
        weighted: bool,
    ) {
        let softness = if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
        let scale = 10f64.powf(if squared { 2.0 * width } else { width });
        let (_, faces) = triangles(seed, 20);
        let renderer = SoftRenderer::new(&faces, size, softness, scale).with_tolerance(1e-4);
        assert_same(&renderer, seed, size, views, own, weighted);
    }
}

#[test]
fn more_pairs_than_are_kept_are_walked_again() {
    // 400 faces that reach most pixels: up to 400 * 32 * 64 / 8 chunks per band.
    let size = [64, 64];
    let softness = EdgeSoftness::new(Family::Logistic);
    let (_, faces) = triangles(3, 20);
    let many = faces.repeat(20);
    let renderer = SoftRenderer::new(&many, size, softness, 0.1);
    for weighted in [false, true] {
        assert_same(&renderer, 3, size, 1, true, weighted);
    }
}

#[test]
fn a_target_that_asks_for_a_gradient_is_a_constant() {
    let renderer = SoftRenderer::new(&[[0, 1, 2]], 6, Family::Logistic, 0.1);
    let corners = vector::<A>(&[-0.6, -0.5, 1.0, 0.7, -0.4, 1.0, 0.1, 0.6, 1.0]);
    let corners = corners.reshape([1, 3, 3]).require_grad();
    let target = vector::<A>(&[1.0; 36]).reshape([1, 6, 6]).require_grad();
    let seen = Projected::new(corners.clone());
    for loss in [
        renderer.mse_loss(seen.clone(), target.clone()),
        renderer.iou_loss(seen.clone(), target.clone()),
    ] {
        let gradients = loss.sum().backward();
        assert!(target.grad(&gradients).is_none() && corners.grad(&gradients).is_some());
    }
}
