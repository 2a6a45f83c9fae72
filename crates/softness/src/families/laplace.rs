use std::f64::consts::LN_2;

use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::math::magnitude;

/// `s(x) = exp(u) / 2` for `u = x / scale < 0`, and `1 - exp(-u) / 2` from there; φ `[1]` is the
/// logarithm of the scale, in the unit of x.
///
/// Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Laplace;

impl UnitStep for Laplace {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let tail = Self::slope(u);
        (tail.clone().neg() + 1.0).mask_where(below, tail)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        magnitude(u).neg().exp() * 0.5
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let size = magnitude(u);
        let thin = (size.clone().neg().exp() * -0.5).log1p().neg();
        (size + LN_2).mask_where(below, thin)
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let tail = Self::slope(u);
        tail.ones_like().mask_where(below, tail.clone() / (tail.neg() + 1.0))
    }
}
