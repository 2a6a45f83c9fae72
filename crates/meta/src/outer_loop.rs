use burn::tensor::{Tensor, backend::Backend};
use serde::Serialize;
use web_time::Instant;

use crate::{
    Adam, MetaEstimate, MetaGradient, Optimizer, Progress, Record, TaskDistribution, adjoint::norm,
    numbers, progress::Best, vector,
};

/// The outer loop: Adam on the mean meta-gradient of batches of instances.
///
/// Source: Wu et al. 2024, Algorithm 1. What goes beyond it:
/// docs/notes.md, Meta-gradients: outer loop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OuterLoop {
    /// How the meta-gradient is taken.
    pub estimator: MetaGradient,
    /// Steps φ.
    pub optimizer: Adam,
    /// Largest norm of the mean gradient; longer ones are shortened to it.
    pub clip: f64,
    /// Updates of φ.
    pub steps: usize,
    /// Instances per update.
    pub batch: usize,
    /// Seed of the first training instance; the others count on from it, none is used twice.
    pub seed: u64,
    /// What decides which softness is kept, and when to stop.
    pub validation: Validation,
}

/// Instances apart from those that are learned on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Validation {
    /// Seed of the first instance; the others count on from it.
    pub seed: u64,
    /// How many.
    pub count: usize,
    /// Updates between two validations. The first and the last softness always have one.
    pub every: usize,
    /// Learning ends after so many validations in a row that were not better than the best.
    pub patience: Option<usize>,
}

/// Learning cannot go on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LearnError {
    /// There is no gradient left to follow.
    #[error(
        "outer step {step}: the loss or its gradient is not finite for any of the {batch} instances; \
         a lower inner learning rate, fewer inner steps or a wider softness may help"
    )]
    AllDropped {
        /// Which outer step.
        step: usize,
        /// Instances tried.
        batch: usize,
    },
}

impl OuterLoop {
    /// Takes one outer step: `None` if learning has finished.
    ///
    /// On an error `progress` is as it was.
    ///
    /// # Errors
    ///
    /// If no instance of the batch has a finite loss and gradient.
    ///
    /// # Panics
    ///
    /// If the batch or the validation is empty, or its interval is 0.
    pub fn step<B: Backend>(
        &self,
        tasks: &impl TaskDistribution<B>,
        progress: &mut Progress,
    ) -> Result<Option<Record>, LearnError> {
        assert!(self.batch > 0, "a batch needs an instance");
        if progress.finished {
            return Ok(None);
        }
        let start = Instant::now();
        let mut next = progress.clone();
        let phi = vector::<B>(&progress.phi);
        let validation_loss = self.validation.validate(tasks, &phi, self.steps, &mut next);
        let mut record = Record {
            step: progress.step,
            loss: None,
            validation_loss,
            gradient_norm: None,
            adjoint_growth: None,
            clips: 0,
            dropped: 0,
            seconds: 0.0,
            phi: progress.phi.clone(),
        };
        if !next.finished {
            self.update(tasks, phi, &mut next, &mut record)?;
        }
        record.seconds = start.elapsed().as_secs_f64();
        next.seconds += record.seconds;
        *progress = next;
        Ok(Some(record))
    }

    fn update<B: Backend>(
        &self,
        tasks: &impl TaskDistribution<B>,
        phi: Tensor<B, 1>,
        progress: &mut Progress,
        record: &mut Record,
    ) -> Result<(), LearnError> {
        let step = progress.step;
        let estimates = (0..self.batch).map(|k| {
            let seed = self.seed.wrapping_add((step * self.batch + k) as u64);
            self.estimator.estimate_on(tasks, seed, &phi)
        });
        let estimates: Vec<_> = estimates.filter(MetaEstimate::is_finite).collect();
        if estimates.is_empty() {
            return Err(LearnError::AllDropped { step, batch: self.batch });
        }
        let share = (estimates.len() as f64).recip();
        let gradients = estimates.iter().map(|estimate| estimate.gradient.clone());
        let mean = gradients.fold(phi.zeros_like(), |sum, gradient| sum + gradient * share);
        let length = norm(&numbers(mean.clone()));

        record.loss = Some(estimates.iter().map(|estimate| estimate.loss * share).sum());
        record.gradient_norm = Some(length);
        record.adjoint_growth = median_growth(&estimates);
        record.clips = estimates.iter().map(|estimate| estimate.clips).sum();
        record.dropped = self.batch - estimates.len();

        let phi = match self.estimator {
            MetaGradient::AlternatingDescent { .. } => phi - mean,
            _ => self.descend(phi, shortened(mean, length, self.clip), progress),
        };
        progress.phi = numbers(phi);
        progress.step += 1;
        progress.dropped += record.dropped;
        progress.tried += self.batch;
        Ok(())
    }

    /// One step of the outer optimiser, whose state is in `progress`.
    fn descend<B: Backend>(
        &self,
        phi: Tensor<B, 1>,
        gradient: Tensor<B, 1>,
        progress: &mut Progress,
    ) -> Tensor<B, 1> {
        let state = if progress.optimizer.is_empty() {
            self.optimizer.init(&phi)
        } else {
            let moments = progress.optimizer.iter().map(|values| vector(values));
            self.optimizer.state(progress.step, moments.collect())
        };
        let (phi, state) = self.optimizer.step(phi, gradient, state);
        let moments = self.optimizer.tensors(state).into_iter();
        progress.optimizer = moments.map(numbers).collect();
        phi
    }
}

/// A gradient of this length, brought to the limit if it is longer.
fn shortened<B: Backend>(gradient: Tensor<B, 1>, length: f64, limit: f64) -> Tensor<B, 1> {
    if length > limit { gradient * (limit / length) } else { gradient }
}

impl Validation {
    /// The loss of `phi` if it is due now; keeps the softness if it is the best so far, and finishes
    /// at the last step and when patience ends.
    fn validate<B: Backend>(
        &self,
        tasks: &impl TaskDistribution<B>,
        phi: &Tensor<B, 1>,
        steps: usize,
        progress: &mut Progress,
    ) -> Option<f64> {
        assert!(self.count > 0 && self.every > 0, "validation needs an instance and an interval");
        let last = progress.step >= steps;
        progress.finished = last;
        if !last && !progress.step.is_multiple_of(self.every) {
            return None;
        }
        let seeds = (0..self.count).map(|k| self.seed.wrapping_add(k as u64));
        let loss = seeds.map(|seed| tasks.validation_loss(seed, phi)).sum::<f64>();
        // A softness under which some instance breaks down is not a good one.
        let loss = Some(loss / self.count as f64).filter(|loss| loss.is_finite());
        match loss.filter(|loss| progress.best.as_ref().is_none_or(|best| *loss < best.loss)) {
            Some(loss) => {
                let phi = progress.phi.clone();
                progress.best = Some(Best { step: progress.step, loss, phi });
                progress.stale = 0;
            }
            None => progress.stale += 1,
        }
        progress.finished |= self.patience.is_some_and(|patience| progress.stale >= patience);
        loss
    }
}

/// `None` where no mode walked back.
fn median_growth<B: Backend>(estimates: &[MetaEstimate<B>]) -> Option<f64> {
    let walked = estimates.iter().filter(|estimate| !estimate.adjoint_norms.is_empty());
    let mut growth: Vec<f64> = walked.map(|estimate| estimate.adjoint_growth).collect();
    growth.sort_by(f64::total_cmp);
    growth.get(growth.len() / 2).copied().filter(|growth| growth.is_finite())
}
