//! Losses of pictures and surfaces: values computed in another way, derivatives compared with central differences.

use softrast_raster::{
    edge_length, huber_loss, l1_loss, multi_scale_loss, normal_consistency, ssim_loss,
};
use softrast_tensor::{Autodiff, NdArray, Tensor, numbers, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

pub(super) type Of = fn(Tensor<AA, 1>) -> Tensor<AA, 1>;

const SIDES: [usize; 4] = [2, 3, 12, 16];
const PIXELS: usize = 2 * 3 * 12 * 16;

pub(super) fn wave(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|k| (step * k as f64 + 0.3).sin()).collect()
}

/// Two pictures for each of two views, in [0, 1].
fn pixels() -> Vec<f64> {
    wave(2 * PIXELS, 0.37).into_iter().map(|x| x * x).collect()
}

fn pictures(x: Tensor<AA, 1>) -> [Tensor<AA, 4>; 2] {
    [0, PIXELS].map(|start| x.clone().narrow(0, start, PIXELS).reshape(SIDES))
}

fn plain(x: &[f64]) -> Tensor<AA, 1> {
    vector::<AA>(x)
}

fn of(loss: fn(Tensor<AA, 4>, Tensor<AA, 4>) -> Tensor<AA, 1>, x: &[f64]) -> Vec<f64> {
    let [image, target] = pictures(plain(x));
    numbers(loss(image, target).inner().inner())
}

/// The gradient of the sum of a loss, and the gradient of a weighted sum of that.
pub(super) fn derivatives(of: Of, x: &[f64], weights: &[f64]) -> [Vec<f64>; 2] {
    let inner = vector::<A>(x).require_grad();
    let outer = Tensor::<AA, 1>::from_inner(inner.clone()).require_grad();
    let gradient = outer.grad(&of(outer.clone()).sum().backward()).expect("a gradient");
    let pulled = (gradient.clone() * vector::<A>(weights)).sum().backward();
    [numbers(gradient.inner()), inner.grad(&pulled).map_or(vec![0.0; x.len()], numbers)]
}

/// Asserts both orders along a few directions, compared with differences.
pub(super) fn assert_derivatives(of: Of, x: &[f64]) {
    let h = 1e-5;
    let weights = wave(x.len(), 2.1);
    let [gradient, second] = derivatives(of, x, &weights);
    assert!(gradient.iter().chain(&second).all(|g| g.is_finite()));
    for step in [0.7, 1.9] {
        let direction = wave(x.len(), step);
        let at = |h: f64| {
            let moved: Vec<_> = x.iter().zip(&direction).map(|(x, d)| x + h * d).collect();
            let value: f64 = numbers(of(plain(&moved)).inner().inner()).iter().sum();
            let [gradient, _] = derivatives(of, &moved, &weights);
            (value, gradient.iter().zip(&weights).map(|(g, w)| g * w).sum::<f64>())
        };
        let along = |of: &[f64]| of.iter().zip(&direction).map(|(g, d)| g * d).sum::<f64>();
        let (more, less) = (at(h), at(-h));
        let first = (more.0 - less.0) / (2.0 * h);
        assert!((along(&gradient) - first).abs() < 1e-6 * (1.0 + first.abs()));
        let exact = (more.1 - less.1) / (2.0 * h);
        assert!((along(&second) - exact).abs() < 1e-5 * (1.0 + exact.abs()));
    }
}

#[test]
fn picture_losses_are_what_they_say() {
    let x = pixels();
    let pairs = |view: usize| {
        let length = PIXELS / 2;
        let [a, b] =
            [&x[..PIXELS], &x[PIXELS..]].map(|all| &all[view * length..(view + 1) * length]);
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect::<Vec<_>>()
    };
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let close = |found: Vec<f64>, exact: [f64; 2]| {
        for (found, exact) in found.iter().zip(exact) {
            assert!((found - exact).abs() < 1e-12, "{found} instead of {exact}");
        }
    };
    close(of(l1_loss, &x), [0, 1].map(|view| mean(pairs(view))));
    let huber = |d: f64| if d <= 0.2 { d * d / 2.0 } else { 0.2 * (d - 0.1) };
    let of_huber = of(|a, b| huber_loss(a, b, 0.2), &x);
    close(of_huber, [0, 1].map(|view| mean(pairs(view).into_iter().map(huber).collect())));
    // Constant pictures with a difference of a quarter are the same on every level.
    let mut flat = vec![0.5; PIXELS];
    flat.extend(vec![0.25; PIXELS]);
    close(of(|a, b| multi_scale_loss(a, b, 3, l1_loss), &flat), [0.25; 2]);
}

/// The similarity of one view, window by window.
fn similarity(a: &[f64], b: &[f64]) -> f64 {
    let [_, channels, height, width] = SIDES;
    let curve: Vec<f64> = (0..11).map(|k| (-(k as f64 - 5.0).powi(2) / 4.5).exp()).collect();
    let total: f64 = curve.iter().sum();
    let (mut sum, mut count) = (0.0, 0.0);
    for channel in 0..channels {
        for top in 0..=height - 11 {
            for left in 0..=width - 11 {
                let mut m = [0.0; 5];
                for i in 0..11 {
                    for j in 0..11 {
                        let at = (channel * height + top + i) * width + left + j;
                        let weight = curve[i] * curve[j] / (total * total);
                        let (a, b) = (a[at], b[at]);
                        for (m, term) in m.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                            *m += weight * term;
                        }
                    }
                }
                let [a, b, aa, bb, ab] = m;
                let (c1, c2) = (1e-4, 9e-4);
                sum += (2.0 * a * b + c1) * (2.0 * (ab - a * b) + c2)
                    / ((a * a + b * b + c1) * (aa - a * a + bb - b * b + c2));
                count += 1.0;
            }
        }
    }
    sum / count
}

#[test]
fn structural_similarity_is_that_of_all_windows() {
    let x = pixels();
    let length = PIXELS / 2;
    for (view, found) in of(ssim_loss, &x).into_iter().enumerate() {
        let [a, b] =
            [&x[..PIXELS], &x[PIXELS..]].map(|all| &all[view * length..(view + 1) * length]);
        assert!((1.0 - found - similarity(a, b)).abs() < 1e-12, "view {view}");
    }
    let same = [&x[..PIXELS], &x[..PIXELS]].concat();
    assert!(of(ssim_loss, &same).iter().all(|found| found.abs() < 1e-12));
}

#[test]
fn picture_losses_have_both_derivatives() {
    let all: [Of; 4] = [
        |x| {
            let [image, target] = pictures(x);
            l1_loss(image, target)
        },
        |x| {
            let [image, target] = pictures(x);
            huber_loss(image, target, 0.2)
        },
        |x| {
            let [image, target] = pictures(x);
            ssim_loss(image, target)
        },
        |x| {
            let [image, target] = pictures(x);
            multi_scale_loss(image, target, 2, ssim_small)
        },
    ];
    for of in all {
        assert_derivatives(of, &pixels());
    }
}

/// Pictures of half the size are smaller than a window: squares are used there.
fn ssim_small(image: Tensor<AA, 4>, target: Tensor<AA, 4>) -> Tensor<AA, 1> {
    match image.dims()[2] {
        12 => ssim_loss(image, target),
        _ => huber_loss(image, target, 10.0),
    }
}

#[test]
fn surface_losses_have_both_derivatives_also_where_faces_collapse() {
    let all: [Of; 2] = [
        |x| normal_consistency(x.reshape([2, 3, 20])),
        |x| edge_length(x.reshape([2, 3, 20]), 0.3),
    ];
    for of in all {
        assert_derivatives(of, &wave(120, 0.83));
        let [gradient, second] = derivatives(of, &[0.1; 120], &wave(120, 2.1));
        assert!(gradient.iter().chain(&second).all(|g| g.is_finite()));
    }
}
