use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::math::rise;

/// Argument at which the double exponential is settled: `exp(-exp(20))` is 0.
const SETTLED: f64 = 20.0;

/// Below this argument the series of [`expm1_ratio`] is used; its first omitted term is 3e-22.
const SMALL: f64 = 1e-2;

/// `s(x) = exp(-exp(-x / scale))`; φ `[1]` is the logarithm of the scale, in the unit of x.
///
/// Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GumbelMax;

/// `s(x) = 1 - exp(-exp(x / scale))`; φ `[1]` is the logarithm of the scale, in the unit of x.
///
/// Its optical depth, `exp(x / scale)`, is constant from 20 scales inside on, at 4.9e8. Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GumbelMin;

/// `(1 - exp(-v)) / v` for `v >= 0`, with 1 at 0.
fn expm1_ratio<B: Backend, const D: usize>(v: Tensor<B, D>) -> Tensor<B, D> {
    let small = v.clone().lower_elem(SMALL);
    let near = v.clone().clamp_max(SMALL);
    // 1 - v/2 (1 - v/3 (1 - v/4 …)).
    let series = (2..=8)
        .rev()
        .fold(v.ones_like(), |sum, k| (sum * near.clone()) * (-1.0 / f64::from(k)) + 1.0);
    let v = v.mask_fill(small.clone(), 1.0);
    (rise(v.clone()) / v).mask_where(small, series)
}

/// `exp(u)`, clamped to `exp(20)`.
fn growth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
    u.clamp_max(SETTLED).exp()
}

impl UnitStep for GumbelMax {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        growth(u.neg()).neg().exp()
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let v = growth(u.neg());
        v.clone() * v.neg().exp()
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        // -ln(1 - exp(-v)) is u - ln((1 - exp(-v)) / v), as v = exp(-u).
        let below = u.clone().lower_elem(0.0);
        let thin = growth(u.clone().clamp_max(0.0).neg()).neg().exp().neg().log1p().neg();
        let thick = u.clone() - expm1_ratio(growth(u.clamp_min(0.0).neg())).log();
        thick.mask_where(below, thin)
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let v = growth(u.neg());
        v.clone().neg().exp() / expm1_ratio(v)
    }
}

impl UnitStep for GumbelMin {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        rise(growth(u))
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let v = growth(u);
        v.clone() * v.neg().exp()
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        growth(u)
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let settled = u.clone().greater_elem(SETTLED);
        growth(u).mask_fill(settled, 0.0)
    }
}
