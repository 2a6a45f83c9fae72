use std::fmt::Debug;

use burn::tensor::{Tensor, backend::Backend};

use crate::{
    Softness,
    parameter::{in_scales, per_scale},
};

/// A softness `s(x) = S(x / scale)`, given by the step `S` alone; φ `[1]` is the logarithm of the
/// scale, in the unit of x.
pub(crate) trait UnitStep: Clone + Debug + Send + Sync + 'static {
    /// `S(u)`.
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D>;

    /// `dS/du`.
    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D>;

    /// `-ln(1 - S(u))`.
    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D>;

    /// The derivative of [`UnitStep::depth`].
    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D>;
}

impl<S: UnitStep> Softness for S {
    fn parameters(&self) -> usize {
        1
    }

    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        S::step(in_scales(&phi, x))
    }

    fn density<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        S::slope(in_scales(&phi, x)) * per_scale(&phi)
    }

    fn optical_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        S::depth(in_scales(&phi, x))
    }

    fn hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        S::depth_slope(in_scales(&phi, x)) * per_scale(&phi)
    }
}
