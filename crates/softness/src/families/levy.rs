use softrast_tensor::{Backend, Tensor};

use super::half_line::{HalfLine, Law};
use crate::error_function::{erf, erfc};

/// Smaller distances are clamped to this one: `erfc(sqrt(1 / 2y))` is already 0 there in f64.
const FLOOR: f64 = 5e-4;

/// The Levy law, `F(y) = erfc(sqrt(1 / 2y))`; φ `[2]` is the logarithm of the scale, in the unit of
/// x, and the shift in scales. Use it as [`Reversed`](super::Reversed) or
/// [`Forward`](super::Forward).
///
/// `1 - F` decreases like `1 / sqrt(y)`, the slowest of all tails. Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Levy;

impl HalfLine for Levy {
    fn law<B: Backend, const D: usize>(_phi: &Tensor<B, 1>, y: Tensor<B, D>) -> Law<B, D> {
        // The slope is y^(-3/2) exp(-1 / 2y) / sqrt(2 π), in powers of v = 1 / 2y.
        let v = (y.clamp_min(FLOOR) * 2.0).recip();
        let root = v.clone().sqrt();
        let slope = root.clone() * v.clone() * v.neg().exp() * (2.0 / std::f64::consts::PI.sqrt());
        Law { below: erfc(root.clone()), above: erf(root), slope }
    }
}
