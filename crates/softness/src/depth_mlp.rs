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

#[cfg(test)]
mod tests {
    use burn::{
        backend::{Autodiff, NdArray},
        tensor::{DType, TensorData},
    };

    use super::*;
    use crate::initial_mlp;

    type B = Autodiff<NdArray<f64>>;

    fn tensor(values: &[f64]) -> Tensor<B, 1> {
        let data = TensorData::new(values.to_vec(), [values.len()]);
        Tensor::from_data(data, (&Default::default(), DType::F64))
    }

    #[test]
    fn positive_weights_make_a_straight_line_through_zero() {
        let phi = tensor(&initial_mlp(3, 0.1));
        let z = [-2.0, 0.0, 0.25, 0.5, 1.0];
        let f: Vec<f64> = DepthMlp.value(phi.clone(), tensor(&z)).into_data().to_vec().unwrap();
        assert_eq!(f[..2], [0.0, 0.0]);
        assert!((f[2] / f[4] - 0.25).abs() < 1e-15 && (f[3] / f[4] - 0.5).abs() < 1e-15);

        let slope = DepthMlp.derivative(phi, tensor(&z));
        let slope: Vec<f64> = slope.into_data().to_vec().unwrap();
        assert_eq!(slope[..2], [0.0, 0.0]);
        assert!(slope[2..].iter().all(|slope| (slope / f[4] - 1.0).abs() < 1e-15));
    }

    #[test]
    fn the_derivative_agrees_with_the_automatic_one() {
        let weights: Vec<f64> = initial_mlp(5, 0.1).iter().map(|w| (7.0 * w).sin()).collect();
        let z = tensor(&[-1.0, -0.3, 0.2, 0.9]).require_grad();
        let grads = DepthMlp.value(tensor(&weights), z.clone()).sum().backward();
        let found = DepthMlp.derivative(tensor(&weights), z.clone()).into_data();
        let expected = z.grad(&grads).unwrap().into_data();
        let tolerance = burn::tensor::Tolerance::<f64>::absolute(1e-14);
        found.assert_approx_eq(&expected, tolerance);
    }
}
