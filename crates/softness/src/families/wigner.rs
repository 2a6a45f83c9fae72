use std::f64::consts::PI;

use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::math::{magnitude, polynomial};

/// The smallest argument of a square root: bounds its slope, which is infinite at the two ends.
const FLOOR: f64 = 1e-12;

/// `S / y^(3/2)` in powers of `4 y - 1`, for `y = (1 + u) / 2` in [0, 1/2].
///
/// A Chebyshev series, fitted with 50 digits; in f64 its relative error is 1e-16.
#[rustfmt::skip]
const END: [f64; 18] = [
    1.5640088758230826, -0.14069773204745567, -0.007904133414609505, -0.000988305375948152,
    -0.00016438074705694706, -3.1885227473562926e-05, -6.816790504496993e-06,
    -1.5589639025703653e-06, -3.746310613094902e-07, -9.35106858918765e-08,
    -2.4046359103869686e-08, -6.33702671439549e-09, -1.7154095551293811e-09,
    -4.701819275159899e-10, -1.195087879178308e-10, -3.305268408806736e-11,
    -1.5250192434151066e-11, -4.500413206537482e-12,
];

/// `s(x) = 1/2 + (u sqrt(1 - u²) + asin(u)) / π` with `u = x / scale` clamped to ±1, the semicircle distribution; φ `[1]` is the logarithm
/// of the scale, in the unit of x.
///
/// Within 1e-12 scales of the two ends, the second derivative of s is bounded, not infinite. Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wigner;

impl UnitStep for Wigner {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        // From the end of the tail: the textbook formula loses all digits there.
        let below = u.clone().lower_elem(0.0);
        let y = ((magnitude(u).neg() + 1.0) * 0.5).clamp_min(0.0);
        let tail = y.clone() * y.clone().clamp_min(FLOOR).sqrt() * polynomial(&END, y * 4.0 - 1.0);
        (tail.clone().neg() + 1.0).mask_where(below, tail)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let outside = u.clone().abs().greater_equal_elem(1.0);
        let u = u.clamp(-1.0, 1.0);
        let height = ((u.clone() + 1.0) * (u.neg() + 1.0)).clamp_min(FLOOR).sqrt();
        (height * (2.0 / PI)).mask_fill(outside, 0.0)
    }
}
