use std::f64::consts::{FRAC_1_SQRT_2, LN_2, PI};

use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::{
    error_function::{erfc, ln_erfcx, per_erfcx},
    math::magnitude,
};

/// `s(x) = Φ(x / scale)`, the normal distribution; φ `[1]` is the logarithm of the scale, which is
/// the standard deviation in the unit of x.
///
/// Source: Wu et al. 2024, Sec. 4.2 (Gauss); Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gauss;

impl UnitStep for Gauss {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let tail = erfc(magnitude(u) * FRAC_1_SQRT_2) * 0.5;
        (tail.clone().neg() + 1.0).mask_where(below, tail)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        (u.clone() * u * -0.5).exp() / (2.0 * PI).sqrt()
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let reach = magnitude(u) * FRAC_1_SQRT_2;
        let thin = (erfc(reach.clone()) * -0.5).log1p().neg();
        let thick = reach.clone() * reach.clone() - ln_erfcx(reach) + LN_2;
        thick.mask_where(below, thin)
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let below = u.clone().lower_elem(0.0);
        let reach = magnitude(u.clone()) * FRAC_1_SQRT_2;
        let thin = Self::slope(u) / (erfc(reach.clone()) * -0.5 + 1.0);
        let thick = per_erfcx(reach) * (2.0 / PI).sqrt();
        thick.mask_where(below, thin)
    }
}
