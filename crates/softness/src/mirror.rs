use burn::tensor::{Tensor, backend::Backend};

use crate::{EdgeSoftness, Family, Softness};

impl Family {
    /// The family of the mirrored step `1 - s(-x)`, with the same parameters.
    ///
    /// Symmetric families are their own; a one-sided law turns from reversed to forward and back.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::Exp => Self::ExpForward,
            Self::ExpForward => Self::Exp,
            Self::Gamma => Self::GammaForward,
            Self::GammaForward => Self::Gamma,
            Self::Levy => Self::LevyForward,
            Self::LevyForward => Self::Levy,
            Self::GumbelMax => Self::GumbelMin,
            Self::GumbelMin => Self::GumbelMax,
            Self::Logistic
            | Self::Bilogit
            | Self::Gauss
            | Self::Laplace
            | Self::Uniform
            | Self::CubicHermite
            | Self::Wigner
            | Self::Gudermannian
            | Self::Cauchy
            | Self::Reciprocal
            | Self::Mlp => self,
        }
    }
}

impl EdgeSoftness {
    /// `ln s(x)`, same shape as `x`; at most 0, and finite where `s` underflows.
    ///
    /// It is minus the optical depth of the mirrored step at `-x`, so it keeps the digits of tails.
    /// Where `s` reaches 0 exactly, the logarithm stops at that of [`OPAQUE`](crate::OPAQUE).
    pub fn log_value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let mirrored = Self { family: self.family.mirrored(), ..*self };
        mirrored.optical_depth(phi, x.neg()).neg()
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        backend::NdArray,
        tensor::{DType, TensorData},
    };

    use super::*;
    use crate::OPAQUE;

    type B = NdArray<f64>;

    fn tensor(values: &[f64]) -> Tensor<B, 1> {
        let data = TensorData::new(values.to_vec(), [values.len()]);
        Tensor::from_data(data, (&Default::default(), DType::F64))
    }

    #[test]
    fn the_exponential_of_the_logarithm_is_the_value() {
        let x = [-0.4, -0.11, -0.02, 0.0, 0.03, 0.2, 0.7];
        for family in Family::ALL {
            for squared in [false, true] {
                let softness = EdgeSoftness { family, squared };
                let phi = tensor(&softness.default_phi(0.1));
                let log: Vec<f64> =
                    softness.log_value(phi.clone(), tensor(&x)).into_data().iter().collect();
                let value: Vec<f64> = softness.value(phi, tensor(&x)).into_data().iter().collect();
                for ((x, log), value) in x.iter().zip(log).zip(value) {
                    let off = (log.exp() - value).abs();
                    let name = format!("{family}, squared {squared}, x = {x}");
                    assert!(off <= 1.1 * OPAQUE, "{name}: exp({log}) and {value}");
                    assert!(log <= 0.0, "{name}: {log}");
                }
            }
        }
    }

    #[test]
    fn tails_that_underflow_keep_their_logarithm() {
        let log = |family: Family| -> f64 {
            let phi = tensor(&family.default_phi(1e-3));
            let softness = EdgeSoftness { family, squared: false };
            softness.log_value(phi, tensor(&[-2.0])).into_scalar()
        };
        assert!((log(Family::Logistic) + 2000.0).abs() < 1e-9);
        assert!((log(Family::Exp) + 2000.0).abs() < 1e-9);
        // ln Φ(-u) = -u²/2 - ln(u sqrt(2π)) + O(u⁻²).
        let u: f64 = 2000.0;
        let expected = -0.5 * u * u - (u * (2.0 * std::f64::consts::PI).sqrt()).ln();
        assert!((log(Family::Gauss) - expected).abs() < 1e-5);
        assert!((log(Family::Uniform) - OPAQUE.ln()).abs() < 1e-12);
    }
}
