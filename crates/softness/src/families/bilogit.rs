use softrast_tensor::{Backend, Tensor};

use super::{logistic::Logistic, unit_step::UnitStep};
use crate::{
    Softness,
    math::{in_scales, ln_scale, magnitude, parameter, per_scale},
    softness::curve,
};

/// A logistic whose argument has two slopes: `s = sigmoid(a tanh(y) + y / r)` with `y = x / (2 scale)`.
///
/// φ `[3]` holds the logarithms of twice the scale, in the unit of x, of the height a and of the ratio r. The slope of the argument in y is
/// a + 1/r near the edge, up to about two scales, and 1/r far from it: a steep edge with wide tails, or the reverse. With a = r = 1 it is
/// as steep at the edge as a logistic of the same scale. It fits the learned networks released with the paper to 5e-5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bilogit;

impl Bilogit {
    /// The argument of the sigmoid.
    fn logit<B: Backend, const D: usize>(phi: &Tensor<B, 1>, y: Tensor<B, D>) -> Tensor<B, D> {
        let [height, slope] = height_and_slope(phi);
        y.clone().tanh() * height + y * slope
    }

    /// The derivative of the logit with respect to x.
    fn logit_slope<B: Backend, const D: usize>(
        phi: &Tensor<B, 1>,
        y: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let [height, slope] = height_and_slope(phi);
        // sech² from exp(-2 |y|): 1 - tanh² loses all digits where tanh saturates.
        let decay = (magnitude(y) * -2.0).exp();
        let upper = (decay.clone() + 1.0).recip();
        (decay * upper.clone() * upper * 4.0 * height + slope) * per_scale(phi)
    }
}

fn height_and_slope<B: Backend, const D: usize>(phi: &Tensor<B, 1>) -> [Tensor<B, D>; 2] {
    [parameter(phi, 1).exp(), parameter(phi, 2).neg().exp()]
}

impl Softness for Bilogit {
    fn parameters(&self) -> usize {
        3
    }

    fn logarithms(&self) -> usize {
        3
    }

    fn default_phi(&self, scale: f64) -> Vec<f64> {
        vec![ln_scale(2.0 * scale), 0.0, 0.0]
    }

    fn scale(&self, phi: &[f64]) -> f64 {
        phi[0].exp() / 2.0
    }

    curve!(self.value(phi, x) => Logistic::step(Self::logit(&phi, in_scales(&phi, x))));
    curve!(self.density(phi, x) => {
        let y = in_scales(&phi, x);
        Logistic::slope(Self::logit(&phi, y.clone())) * Self::logit_slope(&phi, y)
    });

    curve!(self.optical_depth(phi, x) => {
        Logistic::depth(Self::logit(&phi, in_scales(&phi, x)))
    });

    curve!(self.hazard(phi, x) => {
        let y = in_scales(&phi, x);
        Logistic::depth_slope(Self::logit(&phi, y.clone())) * Self::logit_slope(&phi, y)
    });
}
