use std::fmt::Debug;

use softrast_tensor::{Backend, Tensor};

use crate::{
    Softness,
    math::{bounded_depth, bounded_hazard, in_scales, per_scale},
    softness::curve,
};

/// A softness `s(x) = S(x / scale)`, defined by the step `S`; φ `[1]` is the logarithm of the scale, in the unit of x.
pub(crate) trait UnitStep: Clone + Debug + Send + Sync + 'static {
    /// `S(u)`.
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D>;

    /// `dS/du`.
    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D>;

    /// `-ln(1 - S(u))`. Provided: for a symmetric step that reaches 1, see [`OPAQUE`](crate::OPAQUE).
    fn depth<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        bounded_depth(Self::step(u.clone()), Self::step(u.neg()))
    }

    /// The derivative of [`UnitStep::depth`]. Provided: for a symmetric step that reaches 1.
    fn depth_slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        bounded_hazard(Self::slope(u.clone()), Self::step(u.neg()))
    }
}

impl<S: UnitStep> Softness for S {
    curve!(self.value(phi, x) => S::step(in_scales(&phi, x)));
    curve!(self.density(phi, x) => S::slope(in_scales(&phi, x)) * per_scale(&phi));
    curve!(self.optical_depth(phi, x) => S::depth(in_scales(&phi, x)));
    curve!(self.hazard(phi, x) => S::depth_slope(in_scales(&phi, x)) * per_scale(&phi));
}
