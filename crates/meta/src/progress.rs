use serde::{Deserialize, Serialize};

use crate::exact;

/// How far learning has come: all that has to be kept to go on as though it had never stopped.
///
/// There is no state of a random generator in it: instances are numbered through, and everything
/// random about one follows from its seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Progress {
    /// Updates of φ so far; records of this and later steps, if some are on file, will come again.
    pub step: usize,
    /// The softness `[P]`.
    #[serde(with = "exact::vector")]
    pub phi: Vec<f64>,
    /// Tensors of the outer optimiser's state `[P]` each, in its order.
    pub(crate) optimizer: Vec<Moment>,
    /// The best softness so far, once there was a validation.
    pub best: Option<Best>,
    /// Validations since then that were not better.
    pub(crate) stale: usize,
    /// Whether all steps are done, or patience is at its end.
    pub finished: bool,
    /// Instances dropped so far.
    pub dropped: usize,
    /// Instances tried so far, those of validations not counted.
    pub tried: usize,
    /// Time spent so far.
    #[serde(with = "exact::number")]
    pub seconds: f64,
}

/// The softness with the least validation loss.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Best {
    /// Updates of φ that led to it.
    pub step: usize,
    /// Its validation loss.
    #[serde(with = "exact::number")]
    pub loss: f64,
    /// The softness `[P]`.
    #[serde(with = "exact::vector")]
    pub phi: Vec<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Moment(#[serde(with = "exact::vector")] pub(crate) Vec<f64>);

impl Progress {
    /// The start, at softness `phi` `[P]`.
    pub fn new(phi: Vec<f64>) -> Self {
        Self {
            step: 0,
            phi,
            optimizer: Vec::new(),
            best: None,
            stale: 0,
            finished: false,
            dropped: 0,
            tried: 0,
            seconds: 0.0,
        }
    }

    /// The best softness so far; the latest one before any validation.
    pub fn best_phi(&self) -> &[f64] {
        self.best.as_ref().map_or(&self.phi, |best| &best.phi)
    }

    /// Whether all vectors have one length and are finite.
    pub(crate) fn is_sound(&self) -> bool {
        let best = self.best.iter().map(|best| &best.phi);
        let moments = self.optimizer.iter().map(|Moment(values)| values);
        let sound = |values: &Vec<f64>| {
            values.len() == self.phi.len() && values.iter().all(|x| x.is_finite())
        };
        sound(&self.phi) && best.chain(moments).all(sound)
    }
}
