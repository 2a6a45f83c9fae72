use softrast_tensor::{Backend, Tensor};

use super::{logistic::Logistic, unit_step::UnitStep};
use crate::{
    Softness, initial_mlp,
    math::{magnitude, with_first},
    network::{WEIGHTS, WIDTH, edge_slope, weights},
    softness::curve,
};

/// Lower bound of the slope of the logit: a flat network has no scale, any finite one will do.
const FLATTEST: f64 = 4e-12;

/// A small network: `s(x) = sigmoid(W5 tanh(h + W4 tanh(W3 tanh(W2 h))))` with `h = tanh(W1 x)`.
///
/// φ `[56]` holds W1 to W5, each in row-major order (output, input); x is not scaled. Without biases the argument of the sigmoid is odd:
/// `s(-x) = 1 - s(x)`. It is also bounded by the sum of |W5|, so s need not reach 0 far outside. s need not be monotone.
///
/// Source: Wu et al. 2024, Eq. 2. Not the kernel released with the paper, which leaves most
/// weights of W2, W3 and W4 unused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mlp;

/// A layer's output `[points, units]` and its derivative with respect to the input of the network.
type Dual<B> = (Tensor<B, 2>, Tensor<B, 2>);

/// A layer without its activation.
fn linear<B: Backend>((h, dh): Dual<B>, weight: Tensor<B, 2>) -> Dual<B> {
    (h.matmul(weight.clone()), dh.matmul(weight))
}

fn tanh<B: Backend>((h, dh): Dual<B>) -> Dual<B> {
    // Both from exp(-2 |h|): 1 - tanh² loses all digits where the unit saturates.
    let below = h.clone().lower_elem(0.0);
    let decay = (magnitude(h) * -2.0).exp();
    let upper = (decay.clone() + 1.0).recip();
    let size = (decay.clone().neg() + 1.0) * upper.clone();
    let value = size.clone().mask_where(below, size.neg());
    (value, dh * decay * upper.clone() * upper * 4.0)
}

impl Mlp {
    /// The argument of the sigmoid, same shape as `x`.
    fn logit<B: Backend, const D: usize>(phi: &Tensor<B, 1>, x: Tensor<B, D>) -> Tensor<B, D> {
        let shape = x.dims();
        let [w1, w2, w3, w4, w5] = weights(phi);
        let h1 = (x.reshape([-1, 1]) * w1).tanh();
        let h2 = h1.clone().matmul(w2).tanh();
        let h3 = h2.matmul(w3).tanh();
        let h4 = (h1 + h3.matmul(w4)).tanh();
        h4.matmul(w5).reshape(shape)
    }

    /// [`Mlp::logit`] and its derivative with respect to x, by forward differentiation.
    fn logit_and_slope<B: Backend, const D: usize>(
        phi: &Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> (Tensor<B, D>, Tensor<B, D>) {
        let shape = x.dims();
        let [w1, w2, w3, w4, w5] = weights(phi);
        let (h1, dh1) = tanh((x.reshape([-1, 1]) * w1.clone(), w1));
        let h2 = tanh(linear((h1.clone(), dh1.clone()), w2));
        let h3 = tanh(linear(h2, w3));
        let (h, dh) = linear(h3, w4);
        let (logit, slope) = linear(tanh((h1 + h, dh1 + dh)), w5);
        (logit.reshape(shape), slope.reshape(shape))
    }
}

impl Softness for Mlp {
    fn parameters(&self) -> usize {
        WEIGHTS
    }

    fn logarithms(&self) -> usize {
        0
    }

    /// [`initial_mlp`] with seed 0.
    fn default_phi(&self, scale: f64) -> Vec<f64> {
        initial_mlp(0, scale)
    }

    /// The scale of a logistic with the same slope at the edge.
    fn scale(&self, phi: &[f64]) -> f64 {
        edge_slope(phi).abs().max(FLATTEST).recip()
    }

    /// The first layer multiplies the distance, so its weights are divided.
    fn with_scale<B: Backend>(&self, phi: Tensor<B, 1>, factor: Tensor<B, 1>) -> Tensor<B, 1> {
        with_first(phi.clone().narrow(0, 0, WIDTH) * factor.recip(), phi)
    }

    fn with_scale_values(&self, phi: &[f64], factor: f64) -> Vec<f64> {
        let mut phi = phi.to_vec();
        phi[..WIDTH].iter_mut().for_each(|weight| *weight *= factor.recip());
        phi
    }

    curve!(self.value(phi, x) => Logistic::step(Self::logit(&phi, x)));
    curve!(self.density(phi, x) => {
        let (logit, slope) = Self::logit_and_slope(&phi, x);
        Logistic::slope(logit) * slope
    });

    curve!(self.optical_depth(phi, x) => Logistic::depth(Self::logit(&phi, x)));
    curve!(self.hazard(phi, x) => {
        let [_, hazard] = self.depth_and_hazard(phi, x);
        hazard
    });

    curve!([self.depth_and_hazard(phi, x); 2] => {
        let (logit, slope) = Self::logit_and_slope(&phi, x);
        [Logistic::depth(logit.clone()), Logistic::depth_slope(logit) * slope]
    });
}
