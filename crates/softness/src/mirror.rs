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
