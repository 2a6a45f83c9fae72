use burn::tensor::{Tensor, backend::Backend};

use crate::Softness;

/// `s(x) = 1 / (1 + exp(-x / scale))`; φ `[1]` is the logarithm of the scale, in the unit of x.
///
/// Source: Wu et al. 2024, Eq. 1, with scale = 1 / phi there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Logistic;

impl Softness for Logistic {
    fn parameters(&self) -> usize {
        1
    }

    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        // Keeps the relative precision of the lower tail, which the form with tanh loses; the
        // clamp keeps the exponential finite in f32 (s stays at 4e-18 beyond it).
        let u = (x / phi.exp().reshape([1; D])).clamp_min(-40.0);
        (u.neg().exp() + 1.0).recip()
    }

    fn density<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let below = self.value(phi.clone(), x.clone());
        let above = self.value(phi.clone(), x.neg());
        below * above / phi.exp().reshape([1; D])
    }

    fn optical_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        // Softplus: max(u, 0) + ln(1 + exp(-|u|)).
        let u = x / phi.exp().reshape([1; D]);
        u.clone().clamp_min(0.0) + u.abs().neg().exp().log1p()
    }

    fn hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        self.value(phi.clone(), x) / phi.exp().reshape([1; D])
    }
}
