use burn::tensor::{Tensor, backend::Backend};

use crate::{Softness, logistic::Logistic, parameter::magnitude, unit_step::UnitStep};

/// Width of the hidden layers.
pub(crate) const WIDTH: usize = 4;

/// Number of weights: `W1 [4, 1]`, `W2`, `W3`, `W4 [4, 4]`, `W5 [1, 4]`.
pub(crate) const WEIGHTS: usize = 2 * WIDTH + 3 * WIDTH * WIDTH;

/// A small network: `s(x) = sigmoid(W5 tanh(h + W4 tanh(W3 tanh(W2 h))))` with `h = tanh(W1 x)`.
///
/// φ `[56]` holds W1 to W5 one after the other, each row by row (output, input); x is taken as it
/// is. Without biases the argument of the sigmoid is odd: `s(-x) = 1 - s(x)`. It is bounded too,
/// by the sum of |W5|, so that s need not reach 0 far outside. Nothing makes it monotone.
///
/// Source: Wu et al. 2024, Eq. 2. Not the kernel released with the paper, which leaves most
/// weights of W2, W3 and W4 unused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mlp;

/// The five weight matrices of `phi`, transposed: `[in, out]`, ready to multiply rows from the left.
pub(crate) fn weights<B: Backend>(phi: &Tensor<B, 1>) -> [Tensor<B, 2>; 5] {
    assert_eq!(phi.dims(), [WEIGHTS], "an MLP softness has {WEIGHTS} weights");
    let block = |from: usize, rows: usize, columns: usize| {
        phi.clone().narrow(0, from, rows * columns).reshape([rows, columns]).transpose()
    };
    let square = WIDTH * WIDTH;
    [
        block(0, WIDTH, 1),
        block(WIDTH, WIDTH, WIDTH),
        block(WIDTH + square, WIDTH, WIDTH),
        block(WIDTH + 2 * square, WIDTH, WIDTH),
        block(WIDTH + 3 * square, 1, WIDTH),
    ]
}

/// A layer's output `[points, units]` and its derivative by the input of the network.
pub(crate) type Dual<B> = (Tensor<B, 2>, Tensor<B, 2>);

/// A layer without its activation.
pub(crate) fn linear<B: Backend>((h, dh): Dual<B>, weight: Tensor<B, 2>) -> Dual<B> {
    (h.matmul(weight.clone()), dh.matmul(weight))
}

fn tanh<B: Backend>((h, dh): Dual<B>) -> Dual<B> {
    // sech² from exp(-2 |h|): 1 - tanh² has no digits left where the unit saturates.
    let decay = (magnitude(h.clone()) * -2.0).exp();
    let upper = (decay.clone() + 1.0).recip();
    (h.tanh(), dh * decay * upper.clone() * upper * 4.0)
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

    /// [`Mlp::logit`] and its derivative by x, carried forward layer by layer.
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

    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        Logistic::step(Self::logit(&phi, x))
    }

    fn density<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let (logit, slope) = Self::logit_and_slope(&phi, x);
        Logistic::slope(logit) * slope
    }

    fn optical_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        Logistic::depth(Self::logit(&phi, x))
    }

    fn hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let (logit, slope) = Self::logit_and_slope(&phi, x);
        Logistic::depth_slope(logit) * slope
    }
}
