use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;
use crate::math::magnitude;

/// `s(x) = 1 / (1 + exp(-x / scale))`; φ `[1]` is the logarithm of the scale, in the unit of x.
///
/// Source: Wu et al. 2024, Eq. 1, with scale = 1 / phi there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Logistic;

impl UnitStep for Logistic {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        // Each half from exp(-|u|), which cannot overflow: the lower tail keeps its digits, which the form with tanh loses.
        let below = u.clone().lower_elem(0.0);
        let decay = magnitude(u).neg().exp();
        let upper = (decay.clone() + 1.0).recip();
        upper.clone().mask_where(below, decay * upper)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let decay = magnitude(u).neg().exp();
        let upper = (decay.clone() + 1.0).recip();
        decay * upper.clone() * upper
    }

    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        // Softplus, as max(u, 0) + ln(1 + exp(-|u|)); selected half by half, because in a sum of the two halves the tail's derivative would
        // be a difference of numbers near 1/2.
        let below = u.clone().lower_elem(0.0);
        let size = magnitude(u);
        let thin = size.clone().neg().exp().log1p();
        (size + thin.clone()).mask_where(below, thin)
    }

    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        Self::step(u)
    }
}
