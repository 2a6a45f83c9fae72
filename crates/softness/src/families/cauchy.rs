use std::f64::consts::{FRAC_1_PI, PI};

use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::math::{atan_ratio, magnitude};

/// Half the tail at one scale from the edge. Smaller tails are clamped to it, since a more precise formula replaces them.
const LEAST_TAIL: f64 = 0.125;

/// `s(x) = 1/2 + atan(x / scale) / π`; φ `[1]` is the logarithm of the scale, in the unit of x.
///
/// The tails decrease like 1 / |x|, too slowly for culling. Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cauchy;

/// `1 - S` at `size >= 0`, and its product with `size` where that is above 1 (unspecified elsewhere).
fn tail<B: Backend, const D: usize>(size: Tensor<B, D>) -> (Tensor<B, D>, Tensor<B, D>) {
    let far = size.clone().greater_elem(1.0);
    let inverse = size.clone().clamp_min(1.0).recip();
    let scaled = atan_ratio(inverse.clone()) * FRAC_1_PI;
    let near = size.clamp_max(1.0).atan() * -FRAC_1_PI + 0.5;
    (near.mask_where(far, inverse * scaled.clone()), scaled)
}

impl UnitStep for Cauchy {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let (tail, _) = tail(magnitude(u));
        (tail.clone().neg() + 1.0).mask_where(below, tail)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        ((u.clone() * u + 1.0) * PI).recip()
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let size = magnitude(u);
        let far = size.clone().greater_elem(1.0);
        let (tail, scaled) = tail(size.clone());
        // Both logarithms are of numbers bounded away from 0 where they are selected.
        let near = tail.clone().clamp_min(LEAST_TAIL).log().neg();
        let thick = near.mask_where(far, size.clamp_min(1.0).log() - scaled.log());
        thick.mask_where(below, tail.neg().log1p().neg())
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let size = magnitude(u.clone());
        let far = size.clone().greater_elem(1.0);
        let (tail, scaled) = tail(size.clone());
        let slope = Self::slope(u);
        let near = slope.clone() / tail.clone().clamp_min(LEAST_TAIL);
        let inverse = size.clamp_min(1.0).recip();
        let rest = (inverse.clone() * inverse.clone() + 1.0) * scaled * PI;
        near.mask_where(far, inverse / rest).mask_where(below, slope / (tail.neg() + 1.0))
    }
}
