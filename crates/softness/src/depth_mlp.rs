use burn::tensor::{Tensor, backend::Backend};

use crate::mlp::{Dual, WEIGHTS, linear, weights};

/// The network that weighs depths: `f(z) = W5 relu(h + W4 relu(W3 relu(W2 h)))`, `h = relu(W1 z)`.
///
/// φ `[56]` is laid out as for [`Mlp`](crate::Mlp); z is the normalised depth, larger is nearer.
/// This is no [`Softness`](crate::Softness): without a sigmoid it is not bounded. Without biases it
/// is a straight line on each side of 0, `f(z) = f(1) z` for z >= 0: 56 weights, one degree of
/// freedom. It is flat where all units of a layer are off.
///
/// Source: Wu et al. 2024, Eq. 3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DepthMlp;

/// With slope 0 at 0.
fn relu<B: Backend>((h, dh): Dual<B>) -> Dual<B> {
    let off = h.clone().lower_equal_elem(0.0);
    (h.mask_fill(off.clone(), 0.0), dh.mask_fill(off, 0.0))
}

impl DepthMlp {
    /// Length of φ.
    pub fn parameters(&self) -> usize {
        WEIGHTS
    }

    /// Weight of a face at depth `z`, same shape as `z`; at least 0 only if φ is.
    pub fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        z: Tensor<B, D>,
    ) -> Tensor<B, D> {
        Self::value_and_slope(&phi, z).0
    }

    /// The derivative of [`DepthMlp::value`] by `z`, same shape; 0 at `z = 0`.
    pub fn derivative<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        z: Tensor<B, D>,
    ) -> Tensor<B, D> {
        Self::value_and_slope(&phi, z).1
    }

    fn value_and_slope<B: Backend, const D: usize>(
        phi: &Tensor<B, 1>,
        z: Tensor<B, D>,
    ) -> (Tensor<B, D>, Tensor<B, D>) {
        let shape = z.dims();
        let [w1, w2, w3, w4, w5] = weights(phi);
        let z = z.reshape([-1, 1]);
        let (h1, dh1) = relu((z.clone() * w1.clone(), z.ones_like() * w1));
        let h2 = relu(linear((h1.clone(), dh1.clone()), w2));
        let h3 = relu(linear(h2, w3));
        let (h, dh) = linear(h3, w4);
        let (value, slope) = linear(relu((h1 + h, dh1 + dh)), w5);
        (value.reshape(shape), slope.reshape(shape))
    }
}
