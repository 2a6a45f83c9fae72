use std::ops::RangeInclusive;

use softrast_tensor::{Backend, Tensor};

use super::half_line::{HalfLine, Law};
use crate::math::{ln_gamma, parameter};

/// Range of shapes for which the fixed numbers of terms below suffice; others are clamped to it.
const SHAPES: RangeInclusive<f64> = 0.02..=20.0;

/// Terms of the power series and of the continued fraction: below 2e-15 at the switch.
const TERMS: usize = 48;

/// The power series is used up to `p + SWITCH`, the continued fraction from there.
const SWITCH: f64 = 2.0;

/// Below this distance, in scales, the distribution function is a parabola through 0 with value and slope of the law at its end.
///
/// For `p < 1` the density increases without bound towards 0; here it is at most `(2 - p) F(FLOOR) / FLOOR`: 1.7e4 per scale for p = 0.5.
/// For `p >= 1` the parabola is a straight line.
const FLOOR: f64 = 1e-8;

/// The Gamma law, `F(y) = P(p, y)`, the regularised incomplete gamma function; φ `[3]` is the
/// logarithm of the scale, in the unit of x, the logarithm of the shape p, and the shift in scales.
/// Use it as [`Reversed`](super::Reversed) or [`Forward`](super::Forward).
///
/// Reversed with p = 0.5, `s = erfc(sqrt(-x / scale))` outside. Shapes lie in [0.02, 20]; closer
/// than 1e-8 scales to the edge, s is a parabola, so that the density stays finite for p < 1.
///
/// Source: Wu et al. 2024, Sec. 4.2 (Gamma, p = 0.5); Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gamma;

/// The incomplete gamma function at one set of distances.
struct Pieces<B: Backend, const D: usize> {
    /// Where the continued fraction is used.
    far: Tensor<B, D, softrast_tensor::Bool>,
    /// `P(p, y)` where the series is used, 0 elsewhere.
    below: Tensor<B, D>,
    /// `dP/dy`.
    slope: Tensor<B, D>,
    /// `-ln Q(p, y)` where the fraction is used.
    far_depth: Tensor<B, D>,
    /// The derivative of `far_depth`.
    far_depth_slope: Tensor<B, D>,
}

impl<B: Backend, const D: usize> Pieces<B, D> {
    fn new(phi: &Tensor<B, 1>, distance: Tensor<B, D>) -> Self {
        let p: Tensor<B, D> = parameter(phi, 1).clamp(SHAPES.start().ln(), SHAPES.end().ln()).exp();
        let y = distance.clone().clamp_min(FLOOR);
        let switch = p.clone() + SWITCH;
        let far = (y.clone() - switch.clone()).greater_equal_elem(0.0);

        // Each is evaluated at clamped arguments only, so that neither sees one for which it fails.
        let y_near = y.clone().clamp_max(SHAPES.end() + SWITCH);
        let ln_front = y_near.clone().log() * p.clone() - y_near.clone();
        let below = (ln_front - ln_gamma(p.clone() + 1.0)).exp() * series(p.clone(), y_near);
        let below = below.mask_fill(far.clone(), 0.0);

        let y_far = (y.clone() + switch).mask_where(far.clone(), y.clone());
        let fraction = fraction(p.clone(), y_far.clone());
        let far_depth =
            y_far.clone() - y_far.log() * p.clone() + ln_gamma(p.clone()) + fraction.clone().log();

        let close = distance.clone().lower_elem(FLOOR);
        let (part, rate) = begun(&p, distance);
        let curve = (y.clone().log() * (p.clone() - 1.0) - y.clone() - ln_gamma(p)).exp();
        let slope = curve.mask_where(close, below.clone() * rate);
        Self { far, below: below * part, slope, far_depth, far_depth_slope: fraction / y }
    }
}

/// The fraction of `F(FLOOR)` reached at `y`, 1 from [`FLOOR`] on, and below it its derivative, per scale.
fn begun<B: Backend, const D: usize>(
    p: &Tensor<B, D>,
    y: Tensor<B, D>,
) -> (Tensor<B, D>, Tensor<B, D>) {
    let line = y.clamp_max(FLOOR) / FLOOR;
    let bend = (p.clone().neg() + 1.0).clamp_min(0.0);
    let part = line.clone() * ((line.clone().neg() + 1.0) * bend.clone() + 1.0);
    let rate = ((line * -2.0 + 1.0) * bend + 1.0) / FLOOR;
    (part, rate)
}

/// `Σ yⁿ / ((p + 1) … (p + n))`.
fn series<B: Backend, const D: usize>(p: Tensor<B, D>, y: Tensor<B, D>) -> Tensor<B, D> {
    (1..=TERMS)
        .rev()
        .fold(y.ones_like(), |sum, k| sum * y.clone() * (p.clone() + k as f64).recip() + 1.0)
}

/// `y + 1 - p - (1 - p) / (y + 3 - p - 2 (2 - p) / (y + 5 - p - …))`.
fn fraction<B: Backend, const D: usize>(p: Tensor<B, D>, y: Tensor<B, D>) -> Tensor<B, D> {
    let start = y - p.clone() + 1.0;
    let deepest = start.clone() + 2.0 * TERMS as f64;
    (1..=TERMS).rev().fold(deepest, |rest, k| {
        let k = k as f64;
        rest.recip() * ((p.clone() - k) * k) + start.clone() + 2.0 * (k - 1.0)
    })
}

impl HalfLine for Gamma {
    // The shape of the paper.
    const SHAPES: &'static [f64] = &[0.5];

    fn law<B: Backend, const D: usize>(phi: &Tensor<B, 1>, y: Tensor<B, D>) -> Law<B, D> {
        let Pieces { far, below, slope, far_depth, .. } = Pieces::new(phi, y);
        let far_above = far_depth.neg().exp();
        let above = (below.clone().neg() + 1.0).mask_where(far.clone(), far_above.clone());
        Law { below: below.mask_where(far, far_above.neg() + 1.0), above, slope }
    }

    fn depth<B: Backend, const D: usize>(phi: &Tensor<B, 1>, y: Tensor<B, D>) -> [Tensor<B, D>; 2] {
        let Pieces { far, below, slope, far_depth, far_depth_slope } = Pieces::new(phi, y);
        let below = below.neg();
        [
            below.clone().log1p().neg().mask_where(far.clone(), far_depth),
            (slope / (below + 1.0)).mask_where(far, far_depth_slope),
        ]
    }
}
