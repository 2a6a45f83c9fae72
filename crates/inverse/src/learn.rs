use serde_json::{Value, json};
use softrast_meta::{Adam, Alone, OuterLoop, Progress, Ranks, Record, Validation};
use softrast_raster::RasterBackend;
use softrast_softness::{EdgeSoftness, Softness};

use crate::{
    Checkpoint, Instances, InverseProblem, LearnConfig, Method, PhiLayout, ScheduledSoftness,
    SolveConfig,
};

/// Largest norm of the mean meta-gradient.
const CLIP: f64 = 1.0;
/// Validations during a run, in addition to that of the start.
const VALIDATIONS: usize = 10;

/// A softness that is being learned on a problem, one update at a time.
///
/// ```
/// use softrast_inverse::{InverseProblem, LearnConfig, Learning, Method, OuterLoss, PoseProblem, ScheduledSoftness, SolveConfig};
/// use softrast_mesh::icosphere;
/// use softrast_raster::HostBackend;
/// use softrast_softness::{EdgeSoftness, Family};
///
/// let problem = PoseProblem::new(&icosphere(0));
/// let start = ScheduledSoftness::constant(EdgeSoftness::new(Family::Gauss), 0.1);
/// let method = Method::new("gauss", start.clone());
/// let solve = SolveConfig { size: 8, steps: 2, ..problem.defaults() };
/// let outer_loss = Some(OuterLoss::Hard);
/// let config = LearnConfig { updates: 2, batch: 1, validation_runs: 1, outer_loss, ..LearnConfig::default() };
/// let learning = || Learning::<_, HostBackend>::new(problem.clone(), &method, &solve, &config);
///
/// let mut first = learning()?;
/// first.step()?;
/// let checkpoint = first.checkpoint("gauss")?;
/// let mut resumed = learning()?;
/// resumed.resume(checkpoint.as_bytes(), "gauss")?;
/// while resumed.step()?.is_some() {}
/// assert_eq!((first.progress().step, resumed.progress().step), (1, 2));
/// let (learned, _) = resumed.learned();
/// assert_eq!((learned.softness, learned.learning_rate), (start.softness, Some(solve.learning_rate)));
/// # anyhow::Ok(())
/// ```
pub struct Learning<P: InverseProblem, B: RasterBackend, S = EdgeSoftness> {
    instances: Instances<P, B, S>,
    outer_loop: OuterLoop,
    progress: Progress,
}

impl<P: InverseProblem, B: RasterBackend, S: Softness> Learning<P, B, S> {
    /// Starts from the softness of `method`, on runs with the settings `solve`.
    ///
    /// # Errors
    ///
    /// If choices contradict each other, or an instance cannot be made.
    pub fn new(
        problem: P,
        method: &Method<S>,
        solve: &SolveConfig,
        config: &LearnConfig,
    ) -> anyhow::Result<Self> {
        let instances = Instances::<P, B, S>::new(problem, method, solve, config)?;
        let config = &instances.config;
        // Checks here what would panic later.
        let last =
            config.seed.saturating_add((config.updates * config.batch).saturating_sub(1) as u64);
        for seed in [config.seed, last, config.validation_seed] {
            instances.problem.instance(seed)?;
        }
        let outer_loop = OuterLoop {
            estimator: config.estimator.unwrap_or_default(),
            optimizer: Adam::new(config.outer_rate),
            clip: CLIP,
            steps: config.updates,
            batch: config.batch,
            seed: config.seed,
            validation: Validation {
                seed: config.validation_seed,
                count: config.validation_runs,
                every: config.updates.div_ceil(VALIDATIONS),
                patience: config.patience,
            },
        };
        let progress = Progress::new(instances.start());
        Ok(Self { instances, outer_loop, progress })
    }

    /// Everything that determines the result, except the problem and the method.
    pub fn identity(&self) -> Value {
        json!({ "config": self.config(), "start": self.instances.start() })
    }

    /// The configuration of learning, resolved for the softness.
    pub fn config(&self) -> &LearnConfig {
        &self.instances.config
    }

    /// Takes an outer step; `None` once learning has finished.
    ///
    /// # Errors
    ///
    /// If learning cannot continue.
    pub fn step(&mut self) -> anyhow::Result<Option<Record>> {
        self.step_shared(&Alone)
    }

    /// [`step`](Self::step) distributed over processes, which all call this at once: [`OuterLoop::step_shared`].
    ///
    /// # Errors
    ///
    /// If learning cannot continue.
    pub fn step_shared(&mut self, ranks: &dyn Ranks) -> anyhow::Result<Option<Record>> {
        Ok(self.outer_loop.step_shared(&self.instances, &mut self.progress, ranks)?)
    }

    /// State of the outer loop.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// The text of a checkpoint of `job`.
    ///
    /// # Errors
    ///
    /// If a number in it cannot be written.
    pub fn checkpoint(&self, job: &str) -> anyhow::Result<String> {
        let progress = self.progress.clone();
        Ok(Checkpoint { job: job.to_owned(), progress }.text()?)
    }

    /// Continues from the text of a checkpoint of the same job.
    ///
    /// # Errors
    ///
    /// If it is damaged or of another job.
    pub fn resume(&mut self, checkpoint: &[u8], job: &str) -> anyhow::Result<()> {
        let parameters = self.progress.phi.len();
        self.progress = Checkpoint::parse(checkpoint, job, &self.outer_loop, parameters)?;
        Ok(())
    }

    /// The layout of the learned vector.
    pub fn layout(&self) -> &PhiLayout<S> {
        &self.instances.layout
    }

    /// The best softness so far, with the learning rate of its runs, and the best of the problem's own parameters.
    pub fn learned(&self) -> (ScheduledSoftness<S>, Vec<f64>) {
        let (phi, optimizer) = self.instances.split_phi(self.progress.best_phi());
        let (softness, own) = self.layout().softness(phi);
        let learning_rate = Some(optimizer.learning_rate);
        (ScheduledSoftness { learning_rate, ..softness }, own)
    }

    /// The problem.
    pub fn problem(&self) -> &P {
        &self.instances.problem
    }
}

/// Learns a softness on runs of a problem with the settings `solve`, passes every outer step to `visit`, and returns the best softness.
///
/// # Errors
///
/// The errors of [`Learning`] and of `visit`.
pub fn learn<P: InverseProblem, B: RasterBackend, S: Softness>(
    problem: P,
    method: &Method<S>,
    solve: &SolveConfig,
    config: &LearnConfig,
    mut visit: impl FnMut(&Record) -> anyhow::Result<()>,
) -> anyhow::Result<ScheduledSoftness<S>> {
    let mut learning = Learning::<P, B, S>::new(problem, method, solve, config)?;
    while let Some(record) = learning.step()? {
        visit(&record)?;
    }
    Ok(learning.learned().0)
}
