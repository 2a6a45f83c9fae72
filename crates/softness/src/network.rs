//! The weights of the two networks of the paper, and their initialisation.

use softrast_tensor::{Backend, Tensor};

/// Width of the hidden layers.
pub(crate) const WIDTH: usize = 4;

/// Number of weights: `W1 [4, 1]`, `W2`, `W3`, `W4 [4, 4]`, `W5 [1, 4]`.
pub(crate) const WEIGHTS: usize = 2 * WIDTH + 3 * WIDTH * WIDTH;

/// The five weight matrices of `phi`, transposed: `[in, out]`, ready to multiply rows from the left.
pub(crate) fn weights<B: Backend>(phi: &Tensor<B, 1>) -> [Tensor<B, 2>; 5] {
    assert_eq!(phi.dims(), [WEIGHTS], "an MLP softness has {WEIGHTS} weights");
    let block = |from: usize, rows: usize, columns: usize| {
        phi.clone().narrow(0, from, rows * columns).reshape([rows, columns]).transpose()
    };
    let square = WIDTH * WIDTH;
    [
        block(0, WIDTH, 1),
        block(WIDTH, WIDTH, WIDTH),
        block(WIDTH + square, WIDTH, WIDTH),
        block(WIDTH + 2 * square, WIDTH, WIDTH),
        block(WIDTH + 3 * square, 1, WIDTH),
    ]
}

/// The logit far inside an untrained MLP: the coverage by 1280 faces on top of one another adds up to less than 1e-3 outside, also where
/// the logit is not yet at its limit. At the limit, ln(1280 / 1e-3) = 14.1 is enough.
const REACH: f64 = 15.0;

/// Initial weights `[56]` of an MLP softness, drawn from `seed`.
///
/// They are uniform in [0, 1), then W5 is scaled so that the logit tends to 15 far inside, and W1 so that its slope at 0 is `1 / scale`.
/// Source: Wu et al. 2024, Sec. 4.1 (random uniform). Not in the paper: the two scalings; without them the logit is at most 4, and every
/// face is visible everywhere.
///
/// # Panics
///
/// If `scale` is not positive.
pub fn initial_mlp(seed: u64, scale: f64) -> Vec<f64> {
    assert!(scale > 0.0 && scale.is_finite(), "scale {scale} is not positive");
    let mut state = seed;
    let mut weights: Vec<f64> = (0..WEIGHTS).map(|_| uniform(&mut state)).collect();

    let (limit, _) = response(&weights, [1.0; WIDTH]);
    weights[WEIGHTS - WIDTH..].iter_mut().for_each(|w| *w *= REACH / limit);
    let slope = edge_slope(&weights);
    weights[..WIDTH].iter_mut().for_each(|w| *w /= slope * scale);
    weights
}

/// The slope of the logit at the edge.
pub(crate) fn edge_slope(weights: &[f64]) -> f64 {
    response(weights, std::array::from_fn(|k| weights[k])).1
}

/// The logit for a first hidden layer `h`, and its linear part in `h` (the slope at 0).
fn response(weights: &[f64], h: [f64; WIDTH]) -> (f64, f64) {
    let (mut full, mut slope) = (h, h);
    for layer in 0..3 {
        let matrix = &weights[WIDTH + layer * WIDTH * WIDTH..][..WIDTH * WIDTH];
        let product = |v: [f64; WIDTH]| -> [f64; WIDTH] {
            std::array::from_fn(|row| (0..WIDTH).map(|k| matrix[row * WIDTH + k] * v[k]).sum())
        };
        full = product(full);
        slope = product(slope);
        let skip = if layer == 2 { h } else { [0.0; WIDTH] };
        full = std::array::from_fn(|k| (full[k] + skip[k]).tanh());
        slope = std::array::from_fn(|k| slope[k] + skip[k]);
    }
    let last = &weights[WEIGHTS - WIDTH..];
    let sum = |v: [f64; WIDTH]| (0..WIDTH).map(|k| last[k] * v[k]).sum();
    (sum(full), sum(slope))
}

/// The next number of the `SplitMix64` generator, in [0, 1).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}
