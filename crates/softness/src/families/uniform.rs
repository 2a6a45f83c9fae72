use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;

/// `s(x) = (1 + x / scale) / 2`, clamped to [0, 1]; φ `[1]` is the logarithm of the scale, in the unit of x.
///
/// At the two kinks the density is 0. Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uniform;

impl UnitStep for Uniform {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        ((u + 1.0) * 0.5).clamp(0.0, 1.0)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        // Computed from u, so that a backward pass has a tape also where the slope is constant.
        let outside = u.clone().abs().greater_equal_elem(1.0);
        (u.clamp(-1.0, 1.0) * 0.0 + 0.5).mask_fill(outside, 0.0)
    }
}
