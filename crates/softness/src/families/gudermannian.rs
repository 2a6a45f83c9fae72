use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::math::{atan_ratio, magnitude};

/// `s(x) = 1/2 + (2/π) atan(tanh(x / (2 scale)))`, the hyperbolic secant distribution; φ `[1]` is
/// the logarithm of the scale, in the unit of x.
///
/// Computed as `(2/π) atan(exp(x / scale))`, which is equal and keeps the digits of the tail. Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gudermannian;

impl UnitStep for Gudermannian {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let tail = magnitude(u).neg().exp().atan() * FRAC_2_PI;
        (tail.clone().neg() + 1.0).mask_where(below, tail)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let decay = magnitude(u).neg().exp();
        decay.clone() * (decay.clone() * decay + 1.0).recip() * FRAC_2_PI
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let size = magnitude(u);
        let decay = size.clone().neg().exp();
        let thin = (decay.clone().atan() * -FRAC_2_PI).log1p().neg();
        (size + FRAC_PI_2.ln() - atan_ratio(decay).log()).mask_where(below, thin)
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let decay = magnitude(u.clone()).neg().exp();
        let thin = Self::slope(u) / (decay.clone().atan() * -FRAC_2_PI + 1.0);
        let thick = ((decay.clone() * decay.clone() + 1.0) * atan_ratio(decay)).recip();
        thick.mask_where(below, thin)
    }
}
