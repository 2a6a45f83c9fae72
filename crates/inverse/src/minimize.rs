use std::{borrow::Borrow, time::Duration};

use anyhow::{Context, ensure};
use softrast_meta::{Adam, AdamState, Optimizer};
use softrast_raster::{HostBackend, RasterBackend};
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tensor::{Autodiff, Tensor, read_sync};
use web_time::Instant;

use crate::{
    AdaptiveStep, Controller, InverseProblem, Iterate, Method, ScaleSchedule, SolveConfig,
    iterate::Run,
};

/// Most starts of a problem that a run with an adaptive schedule uses; after these it restarts from its current scene.
const STARTS: usize = 8;

/// Minimizes a problem's loss from its start, with all `instances` solved together, and returns the final result.
///
/// Every iterate from start to end is passed to `visit`, with the scene on the CPU. Time spent in `visit` does not
/// count as time of a step. Parameters without a gradient, for example where nothing was drawn, do not change. If the
/// softness has an adaptive schedule and a run is stalled, it restarts from the next start of the problem. A [`Minimization`] takes
/// one step per call, and can return images.
///
/// # Errors
///
/// The errors of `visit` and of the device, which end the descent; if there is no instance, or more than one with
/// an adaptive schedule, because each such run has its own progress.
pub fn minimize<P: InverseProblem, B: RasterBackend>(
    problem: &P,
    instances: &[P::Instance],
    method: &Method<impl Softness>,
    config: &SolveConfig,
    mut visit: impl FnMut(&Iterate, &P::Scene<HostBackend>) -> anyhow::Result<()>,
) -> anyhow::Result<Iterate> {
    let mut run = Minimization::<P, B, &P, _>::new(problem, instances.to_vec(), method, config)?;
    let mut last = None;
    while let Some(iterate) = run.next().transpose()? {
        visit(&iterate, run.scene())?;
        last = Some(iterate);
    }
    last.context("a run shows its start at least")
}

/// [`minimize`] one step at a time, for programs that pause and resume: an iterator over all iterates from start to end.
///
/// It owns or borrows the problem. After an error it yields nothing.
///
/// ```
/// use softrast_inverse::{InverseProblem, Method, Minimization, PoseProblem, ScheduledSoftness, SolveConfig};
/// use softrast_mesh::icosphere;
/// use softrast_raster::HostBackend;
///
/// let problem = PoseProblem::new(&icosphere(0));
/// let instances = vec![problem.instance(0)?];
/// let method = Method::new("learned", ScheduledSoftness::learned("pose")?);
/// let config = SolveConfig { size: 8, steps: 3, ..problem.defaults() };
/// let run = Minimization::<PoseProblem, HostBackend>::new(problem, instances, &method, &config)?;
/// let mut run = run.with_pictures();
/// let start = run.next().unwrap()?;
/// assert_eq!((start.step, start.image.map(|image| image.len())), (0, Some(64)));
/// assert_eq!(run.count(), 3);
/// # anyhow::Ok(())
/// ```
pub struct Minimization<
    P: InverseProblem,
    B: RasterBackend,
    R: Borrow<P> = P,
    S: Softness = EdgeSoftness,
> {
    run: Run<P, B, R, S>,
    instances: Vec<P::Instance>,
    config: SolveConfig,
    pictures: bool,
    controller: Option<Controller>,
    /// Factor of the learning rate at the end, without an adaptive schedule.
    rate_end: f64,
    optimizer: Adam,
    theta: Tensor<B, 1>,
    state: AdamState<B, 1>,
    /// Progress and learning rate of the latest step.
    current: AdaptiveStep,
    /// Starts used so far.
    starts: usize,
    latest: Option<Latest<B>>,
    ended: bool,
}

/// The latest iterate, from which the next step is taken.
struct Latest<B: RasterBackend> {
    step: usize,
    leaf: Tensor<Autodiff<B>, 1>,
    loss: Tensor<Autodiff<B>, 1>,
    hard_loss: f64,
    /// Time of drawing it, which counts to the next step.
    drawing: Duration,
}

impl<P: InverseProblem, B: RasterBackend, R: Borrow<P>, S: Softness> Minimization<P, B, R, S> {
    /// A run before its first step.
    ///
    /// # Errors
    ///
    /// If there is no instance, or more than one where the softness has an adaptive schedule.
    pub fn new(
        problem: R,
        instances: Vec<P::Instance>,
        method: &Method<S>,
        config: &SolveConfig,
    ) -> anyhow::Result<Self> {
        ensure!(!instances.is_empty(), "there is no instance to solve");
        let adaptive = method.softness.adaptive;
        let rate_end = method.softness.rate_end.unwrap_or(1.0);
        ensure!(
            instances.len() == 1 || adaptive.is_none(),
            "a softness with an adaptive schedule solves one instance at a time, found {} together: name another softness",
            instances.len()
        );
        let run = Run::<P, B, R, S>::new(problem, &instances, method, config);
        let problem = run.problem.borrow();
        let optimizer = problem.optimizer(config.learning_rate);
        let theta = problem.start(&run.scene).inner();
        Ok(Self {
            state: optimizer.init(&theta),
            current: by_time(rate_end, 0, config.steps),
            rate_end,
            controller: adaptive.map(|adaptive| adaptive.controller(config.steps)),
            config: *config,
            starts: 1,
            latest: None,
            ended: false,
            run,
            instances,
            pictures: false,
            optimizer,
            theta,
        })
    }

    /// This run, with images in its iterates.
    #[must_use]
    pub fn with_pictures(self) -> Self {
        Self { pictures: true, ..self }
    }

    /// The problem.
    pub fn problem(&self) -> &P {
        self.run.problem.borrow()
    }

    /// The scene on the CPU.
    pub fn scene(&self) -> &P::Scene<HostBackend> {
        &self.run.host
    }

    /// Takes the step from the latest iterate, if there is one. Returns the number of steps taken and the time of drawing.
    fn stepped(&mut self) -> (usize, Option<Duration>) {
        let Some(Latest { step, leaf, loss, drawing, .. }) = self.latest.take() else {
            return (0, None);
        };
        let theta = self.theta.clone();
        // The gradients of all losses at once are those of their sum.
        let gradient = leaf.grad(&loss.backward()).unwrap_or_else(|| theta.zeros_like());
        let learning_rate = self.current.rate * self.config.learning_rate;
        let optimizer = Adam { learning_rate, ..self.optimizer };
        let (theta, state) = optimizer.step(theta, gradient, self.state.clone());
        self.state = state;
        self.theta = self.problem().allowed(&self.run.scene, Tensor::from_inner(theta)).inner();
        (step + 1, Some(drawing))
    }

    /// Moves to the progress of the next step, and restarts a stalled run.
    fn advance_schedule(&mut self, step: usize, hard_loss: Option<f64>) {
        self.current = match &mut self.controller {
            Some(run) => run.next(hard_loss),
            None => by_time(self.rate_end, step, self.config.steps),
        };
        if self.current.restarts {
            let problem = self.run.problem.borrow();
            if let Some(other) = problem.restart(&self.instances[0], self.starts, STARTS) {
                self.theta = problem.start(&problem.scene::<B>(&[other], self.config.size));
            }
            (self.state, self.starts) = (self.optimizer.init(&self.theta), self.starts + 1);
        }
    }

    /// The next iterate, as by [`Iterator::next`]. In a browser this is the only way to read results of a GPU.
    pub async fn next_async(&mut self) -> Option<anyhow::Result<Iterate>> {
        if self.ended {
            return None;
        }
        let iterate = self.step().await;
        self.ended |= iterate.is_err();
        Some(iterate)
    }

    async fn step(&mut self) -> anyhow::Result<Iterate> {
        let clock = Instant::now();
        let hard_loss = self.latest.as_ref().map(|latest| latest.hard_loss);
        let (step, drawn) = self.stepped();
        let mut leaf = Tensor::from_inner(self.theta.clone());
        if step < self.config.steps {
            self.advance_schedule(step, hard_loss);
            leaf = Tensor::from_inner(self.theta.clone()).require_grad();
        } else {
            self.ended = true;
        }
        let seconds = drawn.map(|drawing| (drawing + clock.elapsed()).as_secs_f64());
        let clock = Instant::now();
        let seen = self.run.seen(self.current.progress, leaf.clone(), self.pictures);
        // Waits for the GPU, including the end of the previous step. A browser cannot block.
        if cfg!(not(target_family = "wasm")) {
            B::sync(&seen.theta.device())?;
        }
        let (drawing, loss) = (clock.elapsed(), seen.loss.clone());
        let read = self.run.read(step, self.current.progress, seen).await?;
        let iterate = Iterate { seconds, restarts: self.starts - 1, ..read };
        let hard_loss = iterate.hard_loss[0];
        self.latest = Some(Latest { step, leaf, loss, hard_loss, drawing });
        Ok(iterate)
    }
}

impl<P: InverseProblem, B: RasterBackend, R: Borrow<P>, S: Softness> Iterator
    for Minimization<P, B, R, S>
{
    type Item = anyhow::Result<Iterate>;

    fn next(&mut self) -> Option<Self::Item> {
        read_sync(self.next_async())
    }
}

/// Progress and learning rate of a step without an adaptive schedule.
fn by_time(rate_end: f64, step: usize, steps: usize) -> AdaptiveStep {
    let progress = ScaleSchedule::progress(step, steps);
    AdaptiveStep { progress, rate: rate_end.powf(progress), restarts: false }
}
