use serde::{Deserialize, Serialize};

/// State of learning: all that a resumed run needs to continue exactly.
///
/// It holds no state of a random generator: instances are numbered consecutively, and everything
/// random about an instance follows from its seed.
///
/// See [`OuterLoop`](crate::OuterLoop) for an example.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Progress {
    /// Updates of φ so far. A resumed run writes the records of this and later steps again.
    pub step: usize,
    /// The softness `[P]`.
    pub phi: Vec<f64>,
    /// Tensors of the outer optimiser's state `[P]` each, in its order.
    pub(crate) optimizer: Vec<Vec<f64>>,
    /// The best softness so far; `None` before the first validation.
    pub best: Option<Best>,
    /// Validations without an improvement since then.
    pub(crate) stale: usize,
    /// Whether all steps are done or patience is exhausted.
    pub finished: bool,
    /// Instances dropped so far.
    pub dropped: usize,
    /// Instances tried so far, without those of validations.
    pub tried: usize,
    /// Time spent so far.
    pub seconds: f64,
}

/// The softness with the least validation loss.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Best {
    /// Updates of φ that led to it.
    pub step: usize,
    /// Its validation loss.
    pub loss: f64,
    /// The softness `[P]`.
    pub phi: Vec<f64>,
}

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

    /// Checks that learning of `steps` updates can continue from here with `parameters` numbers.
    ///
    /// # Errors
    ///
    /// The reason why it cannot.
    pub fn check(&self, steps: usize, parameters: usize) -> Result<(), String> {
        let Self { step, phi, optimizer, best, seconds, dropped, tried, .. } = self;
        let best_phi = best.iter().map(|best| &best.phi);
        for values in std::iter::once(phi).chain(best_phi).chain(optimizer) {
            if values.len() != parameters {
                return Err(format!("a vector has {} numbers, not {parameters}", values.len()));
            }
            if !values.iter().all(|x| x.is_finite()) {
                return Err("a vector holds what is no finite number".into());
            }
        }
        let best_step = best.as_ref().map_or(0, |best| best.step);
        if *step > steps || best_step > *step {
            return Err(format!("step {step} of {steps}, the best after {best_step}, cannot be"));
        }
        // Adam has two moments after its first step.
        if !(optimizer.is_empty() || optimizer.len() == 2 && *step > 0) {
            return Err(format!("{} moments after step {step} cannot be", optimizer.len()));
        }
        let loss = best.as_ref().map_or(0.0, |best| best.loss);
        if !(loss.is_finite() && seconds.is_finite() && *seconds >= 0.0 && dropped <= tried) {
            return Err("its losses, times or counts cannot be".into());
        }
        Ok(())
    }
}
