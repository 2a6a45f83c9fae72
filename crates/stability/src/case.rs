use serde::Serialize;

use crate::Tested;

/// A way to fail, made worse level by level. To miss the target is a property of the softness; only numbers that are not finite are a
/// fault of the program.
#[derive(Serialize)]
pub struct Case {
    /// Short and unique, such as `F02`; the letter says what is tested: F the image, G its
    /// gradient, O an optimisation, M learning.
    pub id: &'static str,
    /// A few words.
    pub name: &'static str,
    /// Whether it belongs to the quick part.
    #[serde(skip)]
    pub quick: bool,
    /// What is drawn or optimised.
    pub scene: &'static str,
    /// What changes from level to level.
    pub perturbation: &'static str,
    /// What is measured.
    pub measure: &'static str,
    /// When a trial counts as reached.
    pub target: &'static str,
    /// All levels for one method.
    #[serde(skip)]
    pub run: fn(&Tested) -> anyhow::Result<Vec<Level>>,
}

/// One strength of the perturbation.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The strength as a word.
    pub label: String,
    /// The strength as a number, where that makes an axis.
    pub at: Option<f64>,
    /// What was tried at it.
    pub trials: Vec<Trial>,
}

/// One measured number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// What was measured, the lower the better.
    pub value: f64,
    /// Whether it reaches the target.
    pub reached: bool,
    /// Whether it and everything on the way to it are finite numbers.
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

    /// The same, if all of these are finite numbers too.
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
