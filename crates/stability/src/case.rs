use serde::Serialize;

use crate::Tested;

/// A failure mode that gets worse level by level. Missing the target is a property of the softness; only non-finite numbers are a fault of
/// the program.
#[derive(Serialize)]
pub struct Case {
    /// Short unique identifier, such as `F02`. Its letter names the tested part: F the image, G its gradient, O an optimisation, M
    /// learning.
    pub id: &'static str,
    /// Short description.
    pub name: &'static str,
    /// The scene that is drawn or optimised.
    pub scene: &'static str,
    /// The perturbation, which changes from level to level.
    pub perturbation: &'static str,
    /// The measured number.
    pub measure: &'static str,
    /// Criterion for a trial to count as reached.
    pub target: &'static str,
    /// Runs all levels for one method.
    #[serde(skip)]
    pub run: fn(&Tested) -> anyhow::Result<Vec<Level>>,
}

/// One strength of the perturbation.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The strength as a word.
    pub label: String,
    /// The strength as a number, if it makes an axis.
    pub at: Option<f64>,
    /// Trials at this level.
    pub trials: Vec<Trial>,
}

/// One measured number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// The measured number; lower is better.
    pub value: f64,
    /// Whether the trial reaches the target.
    pub reached: bool,
    /// Whether this and all intermediate numbers are finite.
    pub finite: bool,
}

impl Trial {
    /// A trial that reaches its target with at most `limit`.
    pub fn at_most(value: f64, limit: f64) -> Self {
        Self { value, reached: value <= limit, finite: value.is_finite() }
    }

    /// A trial that either holds (0) or does not (1).
    pub fn holds(yes: bool) -> Self {
        Self::at_most(f64::from(u8::from(!yes)), 0.5)
    }

    /// This trial, counted as finite and reached only if all of these numbers are finite too.
    #[must_use]
    pub fn with(mut self, numbers: &[f64]) -> Self {
        self.finite &= numbers.iter().all(|x| x.is_finite());
        self.reached &= self.finite;
        self
    }
}

impl Level {
    /// A level named by its number.
    pub fn new(at: f64, trials: Vec<Trial>) -> Self {
        let label = match at.abs() {
            x if x == 0.0 || (1e-2..1e5).contains(&x) => format!("{at}"),
            _ => format!("{at:e}"),
        };
        Self { label, at: Some(at), trials }
    }

    /// A level with a name.
    pub fn named(label: impl Into<String>, trials: Vec<Trial>) -> Self {
        Self { label: label.into(), at: None, trials }
    }
}
