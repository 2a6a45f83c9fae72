use std::fmt::Debug;

use burn::tensor::{Tensor, backend::Backend};

/// What is left of the light behind a face that the formula calls fully opaque.
///
/// One-sided families reach `s = 1` exactly, where the optical depth `-ln(1 - s)` is infinite. For
/// them it is taken as `-ln(OPAQUE + (1 - OPAQUE)(1 - s))`: at most `-ln(OPAQUE)` = 16.1, and no
/// silhouette moves by more than `OPAQUE`.
pub const OPAQUE: f64 = 1e-7;

/// A soft step: how much a face covers a pixel at signed distance `x`.
///
/// `x` is positive inside the face; its unit is NDC, or NDC² for a softness of the squared
/// distance. All parameters sit in one vector `phi` `[parameters]`; those that must be positive are
/// kept as logarithms. `phi` and `x` must have the same float type. Every method is made of tracked
/// tensor ops, so that gradients of any order reach `phi` and `x`.
pub trait Softness: Clone + Debug + Send + Sync + 'static {
    /// Length of `phi`.
    fn parameters(&self) -> usize;

    /// Coverage `s(x)` in [0, 1], same shape as `x`.
    fn value<B: Backend, const D: usize>(&self, phi: Tensor<B, 1>, x: Tensor<B, D>)
    -> Tensor<B, D>;

    /// Derivative `ds/dx`, in 1 / (unit of x), same shape as `x`.
    fn density<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D>;

    /// Optical depth `q = -ln(1 - s)`, at least 0, computed without forming `1 - s` where that
    /// would lose digits; see [`OPAQUE`] for families that reach 1. Source: META 2.6.
    fn optical_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D>;

    /// Hazard `dq/dx`, the derivative of the optical depth; finite wherever `density` is.
    fn hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D>;
}
