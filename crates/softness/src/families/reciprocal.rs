use std::f64::consts::LN_2;

use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::math::magnitude;

/// `s(x) = 1/2 + u / (2 + 2 |u|)` with `u = x / scale`; φ `[1]` is the logarithm of the scale, in
/// the unit of x.
///
/// The tails decrease like 1 / |x|, too slowly for culling. Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reciprocal;

impl UnitStep for Reciprocal {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let tail = (magnitude(u) + 1.0).recip() * 0.5;
        (tail.clone().neg() + 1.0).mask_where(below, tail)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let inverse = (magnitude(u) + 1.0).recip();
        inverse.clone() * inverse * 0.5
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let size = magnitude(u);
        let thin = ((size.clone() + 1.0).recip() * -0.5).log1p().neg();
        (size.log1p() + LN_2).mask_where(below, thin)
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let inverse = (magnitude(u) + 1.0).recip();
        let thin = inverse.clone() * inverse.clone() / (inverse.clone().neg() + 2.0);
        inverse.mask_where(below, thin)
    }
}
