use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use softrast_tensor::{Backend, Tensor};

use crate::{Softness, families::*, softness::curve};

/// Defines the enum from the list in `families/mod.rs`.
macro_rules! family {
    ([] $($file:ident: $($variant:ident $name:literal => $softness:expr),+;)+) => {
        /// A softness chosen by name at run time.
        ///
        /// Names are snake case: `logistic`, `exp_forward`. If a family has two directions, the plain name is the reversed one (1 inside,
        /// decays outside), as in the rows Exp and Gamma of the paper (Wu et al. 2024, Sec. 4.2).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum Family {
            $($(
                #[doc = concat!("`", stringify!($softness), "` of [`families`](crate::families).")]
                #[serde(rename = $name)]
                $variant,
            )+)+
        }

        impl Family {
            /// Every family, in the order of the documentation.
            pub const ALL: [Self; [$($($name),+),+].len()] = [$($(Self::$variant),+),+];

            /// The name in files and on the command line.
            pub fn name(self) -> &'static str {
                match self {
                    $($(Self::$variant => $name,)+)+
                }
            }

            /// The family of the mirrored step `1 - s(-x)`, with the same parameters.
            ///
            /// Symmetric families are their own mirror image; a reversed law becomes forward and vice versa.
            #[must_use]
            pub fn mirrored(self) -> Self {
                let mut lines = [$(&[$(Self::$variant),+][..]),+].into_iter();
                let other = lines.find(|line| line.contains(&self));
                other.into_iter().flatten().copied().find(|&family| family != self).unwrap_or(self)
            }
        }
    };
}
families!(family);

/// Calls `$family.$method $arguments` on the softness of `$family`.
macro_rules! dispatch {
    ([$family:ident.$method:ident $arguments:tt]
        $($file:ident: $($variant:ident $name:literal => $softness:expr),+;)+) => {
        match $family {
            $($(Self::$variant => $softness.$method $arguments,)+)+
        }
    };
}

impl Softness for Family {
    curve!(self.value(phi, x) => families!(dispatch self.value(phi, x)));

    fn parameters(&self) -> usize {
        families!(dispatch self.parameters())
    }

    curve!(self.density(phi, x) => families!(dispatch self.density(phi, x)));
    curve!(self.optical_depth(phi, x) => families!(dispatch self.optical_depth(phi, x)));
    curve!(self.hazard(phi, x) => families!(dispatch self.hazard(phi, x)));

    curve!([self.depth_and_hazard(phi, x); 2] => {
        families!(dispatch self.depth_and_hazard(phi, x))
    });

    /// Minus the optical depth of the mirrored step at `-x`, which keeps the digits of tails.
    fn log_value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        self.mirrored().optical_depth(phi, x.neg()).neg()
    }

    curve!([self.log_value_and_slope(phi, x); 2] => {
        let [depth, hazard] = self.mirrored().depth_and_hazard(phi, x.neg());
        [depth.neg(), hazard]
    });

    fn default_phi(&self, scale: f64) -> Vec<f64> {
        families!(dispatch self.default_phi(scale))
    }

    fn logarithms(&self) -> usize {
        families!(dispatch self.logarithms())
    }

    fn scale(&self, phi: &[f64]) -> f64 {
        families!(dispatch self.scale(phi))
    }

    fn with_scale<B: Backend>(&self, phi: Tensor<B, 1>, factor: Tensor<B, 1>) -> Tensor<B, 1> {
        families!(dispatch self.with_scale(phi, factor))
    }

    fn with_scale_values(&self, phi: &[f64], factor: f64) -> Vec<f64> {
        families!(dispatch self.with_scale_values(phi, factor))
    }
}

/// No softness family has this name.
///
/// ```
/// use softrast_softness::{Family, UnknownFamily};
///
/// let family: Family = "gamma".parse()?;
/// assert_eq!((family, family.mirrored()), (Family::Gamma, Family::GammaForward));
/// assert_eq!("sigmoid".parse::<Family>(), Err(UnknownFamily { found: "sigmoid".into() }));
/// # Ok::<(), UnknownFamily>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown softness {found:?}; known are {}", Family::ALL.map(Family::name).join(", "))]
pub struct UnknownFamily {
    /// The requested name.
    pub found: String,
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
            assert_eq!(family.mirrored().mirrored(), family);
        }
    }

    #[test]
    fn laws_with_two_directions_are_mirror_images_of_one_another() {
        assert_eq!(Family::Gamma.mirrored(), Family::GammaForward);
        assert_eq!(Family::GumbelMin.mirrored(), Family::GumbelMax);
        assert_eq!(Family::Logistic.mirrored(), Family::Logistic);
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        let message = "sigmoid".parse::<Family>().unwrap_err().to_string();
        assert!(message.starts_with("unknown softness \"sigmoid\"; known are logistic, bilogit,"));
        assert!(message.ends_with(Family::ALL.map(Family::name).join(", ").as_str()));
    }
}
