use softrast_tensor::{Backend, Tensor};

use super::half_line::{HalfLine, Law};
use crate::math::rise;

/// The exponential law, `F(y) = 1 - exp(-y)`; φ `[2]` is the logarithm of the scale, in the unit
/// of x, and the shift in scales. Use it as [`Reversed`](super::Reversed) or
/// [`Forward`](super::Forward).
///
/// Source: Wu et al. 2024, Sec. 4.2 (Exp); Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exp;

impl HalfLine for Exp {
    fn law<B: Backend, const D: usize>(_phi: &Tensor<B, 1>, y: Tensor<B, D>) -> Law<B, D> {
        let above = y.clone().neg().exp();
        Law { below: rise(y), slope: above.clone(), above }
    }

    fn depth<B: Backend, const D: usize>(
        _phi: &Tensor<B, 1>,
        y: Tensor<B, D>,
    ) -> [Tensor<B, D>; 2] {
        let slope = y.ones_like();
        [y, slope]
    }
}
