use softrast_tensor::{Backend, Tensor};

use super::unit_step::UnitStep;

/// `s(x) = 3 y² - 2 y³` with `y = (1 + x / scale) / 2` clamped to [0, 1]; φ `[1]` is the logarithm of the scale, in the unit of x.
///
/// Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CubicHermite;

/// The fraction of the way from one end of the step to the other, in [0, 1].
fn way<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
    ((u + 1.0) * 0.5).clamp(0.0, 1.0)
}

impl UnitStep for CubicHermite {
    fn step<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        let y = way(u);
        y.clone() * y.clone() * (y * -2.0 + 3.0)
    }

    fn slope<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
        way(u.clone()) * way(u.neg()) * 3.0
    }
}
