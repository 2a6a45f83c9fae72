use std::f64::consts::FRAC_1_PI;

use softrast_inverse::NamedSoftness;
use softrast_softness::Softness;
use softrast_tensor::{Backend, Tensor};

/// A custom softness with one method: `s(x) = 1/2 + atan(x / scale) / π`; φ `[1]` is the logarithm of the scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Arctan;

impl Softness for Arctan {
    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        (x / phi.exp().reshape([1; D])).atan() * FRAC_1_PI + 0.5
    }
}

impl NamedSoftness for Arctan {
    const NAME: &'static str = "arctan";
}
