use burn::tensor::{Tensor, backend::Backend};

/// The largest distance, in scales, that a softness tells apart from infinity.
///
/// Farther distances count as this one: its square still fits an f32, and the slowest tail
/// (Levy) has come to within 3e-8 of its limit.
pub(crate) const FAR: f64 = 1e15;

/// Entry `k` of `phi`, shaped `[1; D]` so that it broadcasts over distances.
pub(crate) fn parameter<B: Backend, const D: usize>(phi: &Tensor<B, 1>, k: usize) -> Tensor<B, D> {
    phi.clone().narrow(0, k, 1).reshape([1; D])
}

/// One over the scale, whose logarithm is the first entry of `phi`.
///
/// The exponential of the negated logarithm: dividing by the scale would square it in the backward
/// pass, which leaves the range of f32 for small scales.
pub(crate) fn per_scale<B: Backend, const D: usize>(phi: &Tensor<B, 1>) -> Tensor<B, D> {
    parameter(phi, 0).neg().exp()
}

/// The distance `x` in units of the scale, within ±[`FAR`].
pub(crate) fn in_scales<B: Backend, const D: usize>(
    phi: &Tensor<B, 1>,
    x: Tensor<B, D>,
) -> Tensor<B, D> {
    (x * per_scale(phi)).clamp(-FAR, FAR)
}

/// `|u|`, with slope 1 at 0.
///
/// `Tensor::abs` has slope 0 there, so that a formula in `|u|`, read from the side of positive `u`,
/// would get a wrong derivative at 0.
pub(crate) fn magnitude<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
    let below = u.clone().lower_elem(0.0);
    u.clone().mask_where(below, u.neg())
}
