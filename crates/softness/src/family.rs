use std::{fmt, str::FromStr};

use burn::tensor::{Tensor, backend::Backend};
use serde::{Deserialize, Serialize};

use crate::{
    BiLogit, Cauchy, CubicHermite, Exp, Forward, Gamma, Gauss, Gudermannian, GumbelMax, GumbelMin,
    Laplace, Levy, Logistic, Mlp, Reciprocal, Reversed, Softness, Uniform, Wigner, initial_mlp,
};

/// The shape of the Gamma law that the paper uses.
const GAMMA_SHAPE: f64 = 0.5;

/// A softness chosen by name at run time.
///
/// Names are snake case: `logistic`, `exp_forward`. Where a family has two directions, the plain
/// name is the reversed one (1 inside, decays outside), as in the paper's rows Exp and Gamma.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// [`Logistic`].
    Logistic,
    /// [`BiLogit`].
    Bilogit,
    /// [`Gauss`].
    Gauss,
    /// [`Laplace`].
    Laplace,
    /// [`Exp`], reversed.
    Exp,
    /// [`Exp`], forward.
    ExpForward,
    /// [`Gamma`], reversed.
    Gamma,
    /// [`Gamma`], forward.
    GammaForward,
    /// [`Levy`], reversed.
    Levy,
    /// [`Levy`], forward.
    LevyForward,
    /// [`Uniform`].
    Uniform,
    /// [`CubicHermite`].
    CubicHermite,
    /// [`Wigner`].
    Wigner,
    /// [`Gudermannian`].
    Gudermannian,
    /// [`Cauchy`].
    Cauchy,
    /// [`Reciprocal`].
    Reciprocal,
    /// [`GumbelMax`].
    GumbelMax,
    /// [`GumbelMin`].
    GumbelMin,
    /// [`Mlp`].
    Mlp,
}

/// No softness family has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown softness {found:?}; known are {}", Family::ALL.map(Family::name).join(", "))]
pub struct UnknownFamily {
    /// The name that was asked for.
    pub found: String,
}

/// `$body` with `$softness` bound to the unit struct of `$family`.
macro_rules! with_softness {
    ($family:expr, $softness:ident => $body:expr) => {
        match $family {
            Family::Logistic => {
                let $softness = Logistic;
                $body
            }
            Family::Bilogit => {
                let $softness = BiLogit;
                $body
            }
            Family::Gauss => {
                let $softness = Gauss;
                $body
            }
            Family::Laplace => {
                let $softness = Laplace;
                $body
            }
            Family::Exp => {
                let $softness = Reversed(Exp);
                $body
            }
            Family::ExpForward => {
                let $softness = Forward(Exp);
                $body
            }
            Family::Gamma => {
                let $softness = Reversed(Gamma);
                $body
            }
            Family::GammaForward => {
                let $softness = Forward(Gamma);
                $body
            }
            Family::Levy => {
                let $softness = Reversed(Levy);
                $body
            }
            Family::LevyForward => {
                let $softness = Forward(Levy);
                $body
            }
            Family::Uniform => {
                let $softness = Uniform;
                $body
            }
            Family::CubicHermite => {
                let $softness = CubicHermite;
                $body
            }
            Family::Wigner => {
                let $softness = Wigner;
                $body
            }
            Family::Gudermannian => {
                let $softness = Gudermannian;
                $body
            }
            Family::Cauchy => {
                let $softness = Cauchy;
                $body
            }
            Family::Reciprocal => {
                let $softness = Reciprocal;
                $body
            }
            Family::GumbelMax => {
                let $softness = GumbelMax;
                $body
            }
            Family::GumbelMin => {
                let $softness = GumbelMin;
                $body
            }
            Family::Mlp => {
                let $softness = Mlp;
                $body
            }
        }
    };
}

impl Family {
    /// Every family, in the order of the documentation.
    pub const ALL: [Self; 19] = [
        Self::Logistic,
        Self::Bilogit,
        Self::Gauss,
        Self::Laplace,
        Self::Exp,
        Self::ExpForward,
        Self::Gamma,
        Self::GammaForward,
        Self::Levy,
        Self::LevyForward,
        Self::Uniform,
        Self::CubicHermite,
        Self::Wigner,
        Self::Gudermannian,
        Self::Cauchy,
        Self::Reciprocal,
        Self::GumbelMax,
        Self::GumbelMin,
        Self::Mlp,
    ];

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Logistic => "logistic",
            Self::Bilogit => "bilogit",
            Self::Gauss => "gauss",
            Self::Laplace => "laplace",
            Self::Exp => "exp",
            Self::ExpForward => "exp_forward",
            Self::Gamma => "gamma",
            Self::GammaForward => "gamma_forward",
            Self::Levy => "levy",
            Self::LevyForward => "levy_forward",
            Self::Uniform => "uniform",
            Self::CubicHermite => "cubic_hermite",
            Self::Wigner => "wigner",
            Self::Gudermannian => "gudermannian",
            Self::Cauchy => "cauchy",
            Self::Reciprocal => "reciprocal",
            Self::GumbelMax => "gumbel_max",
            Self::GumbelMin => "gumbel_min",
            Self::Mlp => "mlp",
        }
    }

    /// Parameters to start from: `scale` is in the unit of x, there is no shift, the Gamma shape is
    /// 0.5, the MLP is [`initial_mlp`] with seed 0, and a bilogit is as steep at the edge as a
    /// logistic of that scale: its own is twice as wide, height and ratio are 1.
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    pub fn default_phi(self, scale: f64) -> Vec<f64> {
        assert!(scale > 0.0 && scale.is_finite(), "scale {scale} is not positive");
        match self {
            Self::Gamma | Self::GammaForward => vec![scale.ln(), GAMMA_SHAPE.ln(), 0.0],
            Self::Bilogit => vec![(2.0 * scale).ln(), 0.0, 0.0],
            Self::Exp | Self::ExpForward | Self::Levy | Self::LevyForward => vec![scale.ln(), 0.0],
            Self::Mlp => initial_mlp(0, scale),
            _ => vec![scale.ln()],
        }
    }

    /// How many of the leading parameters are logarithms (of a scale, then of shapes).
    pub(crate) fn logarithms(self) -> usize {
        match self {
            Self::Gamma | Self::GammaForward => 2,
            Self::Bilogit => 3,
            Self::Mlp => 0,
            _ => 1,
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Family {
    type Err = UnknownFamily;

    fn from_str(name: &str) -> Result<Self, UnknownFamily> {
        let found = Self::ALL.into_iter().find(|family| family.name() == name);
        found.ok_or_else(|| UnknownFamily { found: name.to_owned() })
    }
}

impl Softness for Family {
    fn parameters(&self) -> usize {
        with_softness!(self, softness => softness.parameters())
    }

    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        with_softness!(self, softness => softness.value(phi, x))
    }

    fn density<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        with_softness!(self, softness => softness.density(phi, x))
    }

    fn optical_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        with_softness!(self, softness => softness.optical_depth(phi, x))
    }

    fn hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        with_softness!(self, softness => softness.hazard(phi, x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_agree_between_files_and_the_command_line() {
        for family in Family::ALL {
            let json = serde_json::to_value(family).unwrap();
            assert_eq!(json, family.to_string());
            assert_eq!(family.name().parse(), Ok(family));
            assert_eq!(family.default_phi(0.1).len(), family.parameters());
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        let message = "sigmoid".parse::<Family>().unwrap_err().to_string();
        assert!(message.starts_with("unknown softness \"sigmoid\"; known are logistic, bilogit,"));
        assert!(message.ends_with("gumbel_min, mlp"));
    }
}
