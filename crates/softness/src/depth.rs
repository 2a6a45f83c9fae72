use burn::tensor::{Tensor, backend::Backend};

use crate::softness::OPAQUE;

/// `-ln(open)` where `covered + open = 1`, from whichever of the two is the smaller.
///
/// `open` must be positive wherever `covered >= 1/2`.
pub(crate) fn optical_depth_of<B: Backend, const D: usize>(
    covered: Tensor<B, D>,
    open: Tensor<B, D>,
) -> Tensor<B, D> {
    let dense = covered.clone().greater_equal_elem(0.5);
    let thin = covered.mask_fill(dense.clone(), 0.0).neg().log1p().neg();
    let thick = open.mask_fill(dense.clone().bool_not(), 1.0).log().neg();
    thin.mask_where(dense, thick)
}

/// The optical depth of a softness that reaches 1: `-ln(OPAQUE + (1 - OPAQUE) open)`.
///
/// `covered` and `open` add up to 1, both with their own digits; see [`OPAQUE`].
pub(crate) fn bounded_depth<B: Backend, const D: usize>(
    covered: Tensor<B, D>,
    open: Tensor<B, D>,
) -> Tensor<B, D> {
    optical_depth_of(covered * (1.0 - OPAQUE), open * (1.0 - OPAQUE) + OPAQUE)
}

/// The derivative of [`bounded_depth`] where `density` is that of `covered`.
pub(crate) fn bounded_hazard<B: Backend, const D: usize>(
    density: Tensor<B, D>,
    open: Tensor<B, D>,
) -> Tensor<B, D> {
    density * (1.0 - OPAQUE) / (open * (1.0 - OPAQUE) + OPAQUE)
}
