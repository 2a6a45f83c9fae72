use serde::Serialize;
use softrast_tensor::{Backend, Tensor, numbers, vector};
use web_time::Instant;

use crate::{
    Adam, Alone, MetaEstimate, MetaGradient, Optimizer, Progress, Ranks, Record, TaskDistribution,
    adjoint::norm, progress::Best, ranks::shared,
};

/// The outer loop: Adam on the mean meta-gradient of batches of instances.
///
/// Source: Wu et al. 2024, Algorithm 1. Extensions: docs/notes.md, Meta-gradients: outer loop.
///
/// ```
/// use softrast_meta::{
///     Adam, Alone, Best, BilevelProblem, InnerLoop, LearnError, MetaGradient, Objective, OuterLoop, OuterSteps, Progress,
///     Record, Sgd, TaskDistribution, Validation,
/// };
/// use softrast_tensor::{Backend, NdArray, Tensor, vector};
///
/// /// A parabola around φ.
/// struct Parabola;
/// impl<B: Backend> Objective<B> for Parabola {
///     fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
///         (theta - phi).powi_scalar(2)
///     }
/// }
/// /// The squared distance to 1.
/// struct ToOne;
/// impl<B: Backend> Objective<B> for ToOne {
///     fn loss(&self, theta: Tensor<B, 1>, _phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
///         (theta - 1.0).powi_scalar(2)
///     }
/// }
/// /// Starts between 0 and 0.6, whose solutions should be 1.
/// struct Tasks;
/// impl TaskDistribution<NdArray> for Tasks {
///     type Objective = Parabola;
///     type OuterLoss = ToOne;
///     type Optimizer = Sgd;
///
///     fn problem(&self, seed: u64, _phi: &Tensor<NdArray, 1>) -> BilevelProblem<NdArray, Parabola, ToOne, Sgd> {
///         BilevelProblem {
///             objective: Parabola,
///             outer_loss: ToOne,
///             inner: InnerLoop { optimizer: Sgd { learning_rate: 0.25 }, steps: 4 },
///             start: vector(&[0.1 * (seed % 7) as f64]),
///             outer_steps: OuterSteps::Last,
///         }
///     }
/// }
///
/// let learner = OuterLoop {
///     estimator: MetaGradient::default(),
///     optimizer: Adam::new(0.1),
///     clip: 1.0,
///     steps: 20,
///     batch: 2,
///     seed: 100,
///     validation: Validation { seed: 0, count: 3, every: 5, patience: None },
/// };
/// let mut progress = Progress::new(vec![0.0]);
/// // Processes that share the work call the same method, each with its ranks.
/// let first: Result<Option<Record>, LearnError> = learner.step_shared(&Tasks, &mut progress, &Alone);
/// let before = first?.and_then(|record| record.validation_loss).unwrap();
/// while learner.step(&Tasks, &mut progress)?.is_some() {}
/// let Best { loss, phi, .. } = progress.best.as_ref().unwrap();
/// assert!(*loss < 0.05 * before && (phi[0] - 1.0).abs() < 0.2);
/// assert_eq!((progress.best_phi(), progress.check(20, 1)), (&phi[..], Ok(())));
/// # Ok::<(), LearnError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OuterLoop {
    /// Estimator of the meta-gradient.
    pub estimator: MetaGradient,
    /// Optimiser of φ.
    pub optimizer: Adam,
    /// Largest norm of the mean gradient; longer gradients are scaled to it.
    pub clip: f64,
    /// Updates of φ.
    pub steps: usize,
    /// Instances per update.
    pub batch: usize,
    /// Seed of the first training instance; the others count on from it. No instance is used twice.
    pub seed: u64,
    /// Selects the best softness and determines when to stop.
    pub validation: Validation,
}

/// Held-out instances.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Validation {
    /// Seed of the first instance; the others count on from it.
    pub seed: u64,
    /// Number of instances.
    pub count: usize,
    /// Updates between two validations. The first and the last softness are always validated.
    pub every: usize,
    /// Learning ends after this many consecutive validations without an improvement.
    pub patience: Option<usize>,
}

/// An error that ends learning.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LearnError {
    /// No gradient of the batch is finite.
    #[error(
        "outer step {step}: the loss or its gradient is not finite for any of the {batch} instances; \
         a lower inner learning rate, fewer inner steps or a wider softness may help"
    )]
    AllDropped {
        /// The outer step.
        step: usize,
        /// Instances tried.
        batch: usize,
    },
}

impl OuterLoop {
    /// Takes one outer step: `None` if learning has finished.
    ///
    /// On an error `progress` is unchanged.
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
        self.step_shared(tasks, progress, &Alone)
    }

    /// [`step`](OuterLoop::step) distributed over processes, which all call this with equal arguments. Each estimates
    /// some of the instances, and all return the same result, bit by bit that of one process.
    ///
    /// # Errors
    ///
    /// If no instance of the batch has a finite loss and gradient; on all ranks alike.
    ///
    /// # Panics
    ///
    /// If the batch or the validation is empty, or its interval is 0.
    pub fn step_shared<B: Backend>(
        &self,
        tasks: &impl TaskDistribution<B>,
        progress: &mut Progress,
        ranks: &dyn Ranks,
    ) -> Result<Option<Record>, LearnError> {
        assert!(self.batch > 0, "a batch needs an instance");
        if progress.finished {
            return Ok(None);
        }
        let start = Instant::now();
        let mut next = progress.clone();
        let phi = vector::<B>(&progress.phi);
        let validation_loss = self.validation.validate(tasks, &phi, self.steps, &mut next, ranks);
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
            self.update(tasks, phi, &mut next, &mut record, ranks)?;
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
        ranks: &dyn Ranks,
    ) -> Result<(), LearnError> {
        let step = progress.step;
        let estimates = shared(ranks, self.batch, |k| {
            let seed = self.seed.wrapping_add((step * self.batch + k) as u64);
            Estimated::of(&self.estimator.estimate_on(tasks, seed, &phi)).packed()
        });
        let estimates = estimates.iter().map(|packed| Estimated::unpacked(packed));
        let estimates: Vec<_> = estimates.filter(Estimated::is_finite).collect();
        if estimates.is_empty() {
            return Err(LearnError::AllDropped { step, batch: self.batch });
        }
        let share = (estimates.len() as f64).recip();
        let gradients = estimates.iter().map(|estimate| vector::<B>(&estimate.gradient));
        let mean = gradients.fold(phi.zeros_like(), |sum, gradient| sum + gradient * share);
        let length = norm(&numbers(mean.clone()));

        record.loss = Some(estimates.iter().map(|estimate| estimate.loss * share).sum());
        record.gradient_norm = Some(length);
        record.adjoint_growth = median_growth(&estimates);
        record.clips = estimates.iter().map(|estimate| estimate.clips as usize).sum();
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

    /// One step of the outer optimiser. Its state is in `progress`.
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

/// The gradient, whose norm is `length`, scaled to `limit` if it is longer.
fn shortened<B: Backend>(gradient: Tensor<B, 1>, length: f64, limit: f64) -> Tensor<B, 1> {
    if length > limit { gradient * (limit / length) } else { gradient }
}

impl Validation {
    /// The loss of `phi` if a validation is due. Stores the best softness so far, and finishes at
    /// the last step or when patience is exhausted.
    fn validate<B: Backend>(
        &self,
        tasks: &impl TaskDistribution<B>,
        phi: &Tensor<B, 1>,
        steps: usize,
        progress: &mut Progress,
        ranks: &dyn Ranks,
    ) -> Option<f64> {
        assert!(self.count > 0 && self.every > 0, "validation needs an instance and an interval");
        let last = progress.step >= steps;
        progress.finished = last;
        if !last && !progress.step.is_multiple_of(self.every) {
            return None;
        }
        let losses = shared(ranks, self.count, |k| {
            vec![tasks.validation_loss(self.seed.wrapping_add(k as u64), phi)]
        });
        let loss = losses.into_iter().flatten().sum::<f64>();
        // A softness under which some instance has no finite loss is never the best.
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

/// The fields of a [`MetaEstimate`] that an outer step uses, as numbers to send between processes.
struct Estimated {
    loss: f64,
    /// NaN if no step was differentiated.
    adjoint_growth: f64,
    clips: f64,
    gradient: Vec<f64>,
}

impl Estimated {
    fn of<B: Backend>(estimate: &MetaEstimate<B>) -> Self {
        let walked = !estimate.adjoint_norms.is_empty();
        Self {
            loss: estimate.loss,
            adjoint_growth: if walked { estimate.adjoint_growth } else { f64::NAN },
            clips: estimate.clips as f64,
            gradient: numbers(estimate.gradient.clone()),
        }
    }

    fn packed(self) -> Vec<f64> {
        [self.loss, self.adjoint_growth, self.clips].into_iter().chain(self.gradient).collect()
    }

    fn unpacked(numbers: &[f64]) -> Self {
        let [loss, adjoint_growth, clips] = [numbers[0], numbers[1], numbers[2]];
        Self { loss, adjoint_growth, clips, gradient: numbers[3..].to_vec() }
    }

    fn is_finite(&self) -> bool {
        self.loss.is_finite() && self.gradient.iter().all(|x| x.is_finite())
    }
}

/// The median growth of the adjoint; `None` if no estimate has one, or the median is not finite.
fn median_growth(estimates: &[Estimated]) -> Option<f64> {
    let growth = estimates.iter().map(|estimate| estimate.adjoint_growth);
    let mut growth: Vec<f64> = growth.filter(|growth| !growth.is_nan()).collect();
    growth.sort_by(f64::total_cmp);
    growth.get(growth.len() / 2).copied().filter(|growth| growth.is_finite())
}
