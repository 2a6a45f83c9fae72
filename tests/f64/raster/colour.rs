//! Blended colours: by hand, compared with direct sums and with differences, to second order, in any order of the faces, and with weights
//! beyond the range of floats.

use proptest::prelude::*;
use softrast_raster::{Background, blend, hard_colour, nearness};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::{numbers, tensor};

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

const FACES: usize = 4;
const CHANNELS: usize = 3;
const PIXELS: usize = 5;

/// Log weights `[1, faces, pixels]` from anywhere between -6 and 6, and colours in [0, 1].
fn scene() -> (Vec<f64>, Vec<f64>) {
    let weights = (0..FACES * PIXELS).map(|k| 6.0 * (1.7 * k as f64).sin()).collect();
    let colours = (0..FACES * CHANNELS * PIXELS).map(|k| 0.5 + 0.5 * (2.3 * k as f64).cos());
    (weights, colours.collect())
}

fn background<T: Backend>(log_weight: Tensor<T, 1>) -> Background<T> {
    Background { colour: tensor(&[0.1, 0.2, 0.3], [CHANNELS]), log_weight }
}

fn image<T: Backend>(
    log_weight: Tensor<T, 1>,
    colours: &[f64],
    behind: Tensor<T, 1>,
) -> Tensor<T, 3> {
    let faces = log_weight.dims()[0] / PIXELS;
    let colour = tensor(colours, [1, faces, CHANNELS, PIXELS]);
    blend(log_weight.reshape([1, faces, PIXELS]), colour, &background(behind))
}

#[test]
fn nearness_goes_from_the_far_plane_to_the_near_one() {
    let depth = tensor::<B, 1>(&[0.5, 1.0, 2.5, 4.5], [4]);
    assert_eq!(numbers(nearness(depth, [0.5, 2.5])), [1.0, 0.75, 0.0, -1.0]);
}

#[test]
fn a_pixel_worked_by_hand() {
    // Weights 2, 1 and 1: half of the first face, a quarter of the second, a quarter of nothing.
    let log_weight = tensor::<B, 3>(&[2f64.ln(), 0.0], [1, 2, 1]);
    let colour = tensor(&[1.0, 0.0, 0.0, 0.5], [1, 2, 2, 1]);
    let background =
        Background { colour: tensor(&[0.0, 1.0], [2]), log_weight: tensor(&[0.0], [1]) };
    let found = numbers(blend(log_weight, colour, &background));
    for (found, expected) in found.into_iter().zip([0.5, 0.125 + 0.25]) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
}

#[test]
fn the_blend_is_the_direct_sum_over_faces() {
    let (weights, colours) = scene();
    let behind: f64 = -2.0;
    let found =
        numbers(image::<B>(tensor(&weights, [FACES * PIXELS]), &colours, tensor(&[behind], [1])));
    for channel in 0..CHANNELS {
        for pixel in 0..PIXELS {
            let [mut sum, mut total] = [behind.exp() * [0.1, 0.2, 0.3][channel], behind.exp()];
            for face in 0..FACES {
                let weight = weights[face * PIXELS + pixel].exp();
                sum += weight * colours[(face * CHANNELS + channel) * PIXELS + pixel];
                total += weight;
            }
            let found = found[channel * PIXELS + pixel];
            assert!((found - sum / total).abs() < 1e-14, "{found} and {}", sum / total);
        }
    }
}

/// `Σ (C - 0.3)² r` with fixed factors r, as a function of log weights and the background's.
fn objective<T: Backend>(
    weights: Tensor<T, 1>,
    colours: &[f64],
    behind: Tensor<T, 1>,
) -> Tensor<T, 1> {
    let factors: Vec<f64> = (0..CHANNELS * PIXELS).map(|k| 1.0 + (0.7 * k as f64).sin()).collect();
    let off = image(weights, colours, behind) - 0.3;
    (off.clone() * off * tensor(&factors, [1, CHANNELS, PIXELS])).sum()
}

#[test]
fn gradients_and_hessian_products_match_central_differences() {
    let (values, colours) = scene();
    let all: Vec<f64> = values.iter().copied().chain([-1.0]).collect();
    let count = all.len();
    let direction: Vec<f64> = (0..count).map(|k| (0.9 * k as f64).cos()).collect();
    let split =
        |x: &Tensor<A, 1>| (x.clone().narrow(0, 0, count - 1), x.clone().narrow(0, count - 1, 1));
    let gradient = |at: &[f64]| -> Vec<f64> {
        let leaf = tensor::<A, 1>(at, [count]).require_grad();
        let (weights, behind) = split(&leaf);
        let grads = objective(weights, &colours, behind).backward();
        numbers(leaf.grad(&grads).unwrap())
    };
    let value = |at: &[f64]| -> f64 {
        let (weights, behind) = split(&tensor::<A, 1>(at, [count]));
        objective(weights, &colours, behind).inner().into_scalar()
    };
    const H: f64 = 1e-5;
    let moved = |k: usize, h: f64| {
        let mut at = all.clone();
        at[k] += h;
        at
    };
    for (k, grad) in gradient(&all).into_iter().enumerate() {
        let slope = (value(&moved(k, H)) - value(&moved(k, -H))) / (2.0 * H);
        assert!((grad - slope).abs() < 1e-9, "entry {k}: {grad} and {slope}");
    }

    let inner = tensor::<A, 1>(&all, [count]).require_grad();
    let leaf = Tensor::<AA, 1>::from_inner(inner.clone()).require_grad();
    let weights = leaf.clone().narrow(0, 0, count - 1);
    let grads = objective(weights, &colours, leaf.clone().narrow(0, count - 1, 1)).backward();
    let along = (leaf.grad(&grads).unwrap() * tensor(&direction, [count])).sum();
    let product = numbers(inner.grad(&along.backward()).unwrap());
    let shifted = |h: f64| -> Vec<f64> {
        gradient(&all.iter().zip(&direction).map(|(x, d)| x + h * d).collect::<Vec<_>>())
    };
    let (after, before) = (shifted(H), shifted(-H));
    for k in 0..count {
        let expected = (after[k] - before[k]) / (2.0 * H);
        assert!((product[k] - expected).abs() < 1e-8, "entry {k}: {} and {expected}", product[k]);
    }
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(256))]

    #[test]
    fn permuting_the_faces_changes_nothing_above_rounding(
        weights in prop::collection::vec(-400.0..40.0f64, FACES * PIXELS),
        colours in prop::collection::vec(0.0..1.0f64, FACES * CHANNELS * PIXELS),
        behind in -50.0..5.0f64,
        order in Just([0, 1, 2, 3]).prop_shuffle(),
    ) {
        let permuted = |values: &[f64], row: usize| -> Vec<f64> {
            order.iter().flat_map(|&face: &usize| values[face * row..][..row].to_vec()).collect()
        };
        let plain = numbers(image::<B>(tensor(&weights, [FACES * PIXELS]), &colours, tensor(&[behind], [1])));
        let (weights, colours) = (permuted(&weights, PIXELS), permuted(&colours, CHANNELS * PIXELS));
        let shuffled = numbers(image::<B>(tensor(&weights, [FACES * PIXELS]), &colours, tensor(&[behind], [1])));
        for (a, b) in plain.into_iter().zip(shuffled) {
            prop_assert!((a - b).abs() < 1e-14, "{} {}", a, b);
            prop_assert!((0.0..=1.0).contains(&a), "{}", a);
        }
    }
}

#[test]
fn weights_beyond_the_range_of_floats_blend_by_their_ratio() {
    let (_, colours) = scene();
    for far in [-3e4, -30.0, 3e4] {
        let weights = vec![far; FACES * PIXELS];
        let leaf = tensor::<A, 1>(&weights, [FACES * PIXELS]).require_grad();
        let blended = image(leaf.clone(), &colours, tensor(&[far - 900.0], [1]));
        let grads = blended.clone().powi_scalar(2).sum().backward();
        assert!(numbers(leaf.grad(&grads).unwrap()).iter().all(|g| g.is_finite()));
        for (k, found) in numbers(blended.inner()).into_iter().enumerate() {
            let mean = (0..FACES).map(|face| colours[face * CHANNELS * PIXELS + k]).sum::<f64>()
                / FACES as f64;
            assert!((found - mean).abs() < 1e-12, "{found} and {mean}");
        }
    }
}

#[test]
fn the_nearest_face_that_covers_a_pixel_is_seen() {
    // Pixels under the first face, under both, under neither, and on the edge of the second.
    let distance = tensor::<B, 3>(&[0.2, 0.1, -0.1, -0.3, -0.2, 0.3, -0.1, 0.0], [1, 2, 4]);
    let colour = tensor(&[1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0], [1, 2, 1, 4]);
    let seen = |depth: [f64; 2]| {
        let depth = tensor(&depth, [1, 2]);
        numbers(hard_colour(distance.clone(), depth, colour.clone(), tensor(&[9.0], [1])))
    };
    assert_eq!(seen([3.0, 4.0]), [1.0, 1.0, 9.0, 2.0]);
    assert_eq!(seen([4.0, -3.0]), [1.0, 2.0, 9.0, 2.0]);
    assert_eq!(seen([4.0, 4.0]), [1.0, 1.0, 9.0, 2.0]);
}

#[test]
fn narrow_depths_give_the_hard_image() {
    let distance = tensor::<B, 3>(&[0.2, 0.1, -0.1, -0.3, -0.2, 0.3, -0.1, 0.5], [1, 2, 4]);
    let colour = tensor(&[1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0], [1, 2, 1, 4]);
    let near = nearness(tensor::<B, 2>(&[3.0, 4.0], [1, 2]), [2.0, 5.0]);
    // An edge that decays within 1e-4 outside, and a softmax of the depth of 1e-2.
    let edge = distance.clone().clamp_max(0.0) * 1e4;
    let log_weight = edge + near.reshape([1, 2, 1]) * 1e2;
    let background = Background { colour: tensor(&[9.0], [1]), log_weight: tensor(&[-7.0], [1]) };
    let soft = numbers(blend(log_weight, colour.clone(), &background));
    let depth = tensor(&[3.0, 4.0], [1, 2]);
    let hard = numbers(hard_colour(distance, depth, colour, tensor(&[9.0], [1])));
    for (soft, hard) in soft.into_iter().zip(hard) {
        assert!((soft - hard).abs() < 1e-2, "{soft} and {hard}");
    }
}
