use std::{cell::RefCell, marker::PhantomData, rc::Rc};

use burn::{backend::Autodiff, tensor::Tensor};
use serde_json::{Value, json};
use softrast_meta::{
    Adam, BilevelProblem, Checkpoint, InnerLoop, Objective, OuterLoop, Progress, Record,
    TaskDistribution, Validation,
};
use softrast_raster::{RasterBackend, Rasterizer};
use softrast_softness::{EdgeSoftness, Family, ScheduledSoftness, numbers, vector};

use crate::{
    InverseProblem, LearnConfig, Method, OuterLoss, PhiLayout, Resolution, ScheduledRenderer,
    SoftnessAt, SolveConfig,
};

/// Scale of the softness that judges, in pixels of the image that judges: the least one whose gradient does not depend on where between
/// the pixels an edge lies.
const SHARP_PX: f64 = 0.25;
/// The same for [`OuterLoss::Pixels`], nearly hard: at a quarter of a pixel, edges that run through the middle of pixels cost half of
/// what they cost the hard image.
const NEARLY_HARD_PX: f64 = 0.05;
/// Largest norm of the mean meta-gradient.
const CLIP: f64 = 1.0;
/// Validations during a run, beside that of the start.
const VALIDATIONS: usize = 10;

/// A softness that is being learned on a problem, one update at a time.
pub struct Learning<P: InverseProblem, B: RasterBackend> {
    instances: Instances<P, B>,
    outer_loop: OuterLoop,
    progress: Progress,
}

impl<P: InverseProblem, B: RasterBackend> Learning<P, B> {
    /// Begins with what `method` does on runs as `solve` has them.
    ///
    /// # Errors
    ///
    /// If choices contradict each other, or an instance cannot be made.
    pub fn new(
        problem: P,
        method: &Method,
        solve: &SolveConfig,
        config: &LearnConfig,
    ) -> anyhow::Result<Self> {
        let instances = Instances::<P, B>::new(problem, method, solve, config)?;
        let config = &instances.config;
        // What would fail later fails here, where an error can be told.
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

    /// All that decides the result, beside the problem and the method.
    pub fn identity(&self) -> Value {
        json!({ "config": self.config(), "start": self.instances.start() })
    }

    /// How it is learned, with what followed from the softness.
    pub fn config(&self) -> &LearnConfig {
        &self.instances.config
    }

    /// Takes an outer step; `None` once learning has finished.
    ///
    /// # Errors
    ///
    /// If learning cannot go on.
    pub fn step(&mut self) -> anyhow::Result<Option<Record>> {
        Ok(self.outer_loop.step(&self.instances, &mut self.progress)?)
    }

    /// How far it has come.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// All that is needed to go on with `job`, as text.
    ///
    /// # Errors
    ///
    /// If a number in it cannot be written.
    pub fn checkpoint(&self, job: &str) -> anyhow::Result<String> {
        let progress = self.progress.clone();
        Ok(Checkpoint { job: job.to_owned(), progress }.text()?)
    }

    /// Goes on from such a text of the same job.
    ///
    /// # Errors
    ///
    /// If it is damaged or of another job.
    pub fn resume(&mut self, checkpoint: &[u8], job: &str) -> anyhow::Result<()> {
        let parameters = self.progress.phi.len();
        self.progress = Checkpoint::parse(checkpoint, job, &self.outer_loop, parameters)?;
        Ok(())
    }

    /// The layout of the vector that is learned.
    pub fn layout(&self) -> &PhiLayout {
        &self.instances.layout
    }

    /// The best softness so far, and the best parameters of the problem's own. It holds the learning rate of its runs.
    pub fn learned(&self) -> (ScheduledSoftness, Vec<f64>) {
        let (phi, optimizer) = self.instances.parted(self.progress.best_phi());
        let (softness, own) = self.layout().softness(phi);
        let learning_rate = Some(optimizer.learning_rate);
        (ScheduledSoftness { learning_rate, ..softness }, own)
    }

    /// The problem.
    pub fn problem(&self) -> &P {
        &self.instances.problem
    }
}

/// Learns a softness on runs of a problem as `solve` has them, and shows every outer step to `visit`: the best softness.
///
/// # Errors
///
/// Those of [`Learning`] and of `visit`.
pub fn learn<P: InverseProblem, B: RasterBackend>(
    problem: P,
    method: &Method,
    solve: &SolveConfig,
    config: &LearnConfig,
    mut visit: impl FnMut(&Record) -> anyhow::Result<()>,
) -> anyhow::Result<ScheduledSoftness> {
    let mut learning = Learning::<P, B>::new(problem, method, solve, config)?;
    while let Some(record) = learning.step()? {
        visit(&record)?;
    }
    Ok(learning.learned().0)
}

/// The distribution that a softness is learned on: instances of a problem by seed, each solved as `solve` says.
pub struct Instances<P: InverseProblem, B: RasterBackend> {
    problem: Rc<P>,
    solve: SolveConfig,
    config: LearnConfig,
    layout: PhiLayout,
    tolerance: f64,
    /// What judges, where it is soft and does not depend on φ.
    sharp: Option<Rc<ScheduledRenderer>>,
    /// The renderer of the latest φ.
    renderer: RefCell<Option<(Vec<f64>, Rc<ScheduledRenderer>)>>,
    backend: PhantomData<B>,
}

impl<P: InverseProblem, B: RasterBackend> Instances<P, B> {
    /// Of a problem, whose softness begins with what `method` does.
    ///
    /// # Errors
    ///
    /// If choices contradict each other.
    pub fn new(
        problem: P,
        method: &Method,
        solve: &SolveConfig,
        config: &LearnConfig,
    ) -> anyhow::Result<Self> {
        let has_surrogate = method.softness.surrogate.is_some();
        let own = problem.own_phi();
        let parameters = method.softness.parameters() + own.len();
        let config = config.resolved(parameters, has_surrogate)?;
        let layout = PhiLayout::learned(&method.softness, own, solve.steps, solve.size, &config);
        let tolerance = method.learning_tolerance(config.differentiates());
        let sharp = (config.outer_loss != Some(OuterLoss::Hard))
            .then(|| Rc::new(sharp(&problem, config.finer() * solve.size, &config)));
        let (problem, solve, renderer) = (Rc::new(problem), *solve, RefCell::new(None));
        let backend = PhantomData;
        Ok(Self { problem, solve, config, layout, tolerance, sharp, renderer, backend })
    }

    /// φ that learning starts from, with the logarithm of the inner learning rate behind it if that is learned.
    pub fn start(&self) -> Vec<f64> {
        let rate = self.config.learn_rate.then(|| self.solve.learning_rate.ln());
        self.layout.start().into_iter().chain(rate).collect()
    }

    /// The part of φ that is the softness, and what steps the inner loop.
    fn parted<'a>(&self, phi: &'a [f64]) -> (&'a [f64], Adam) {
        match phi.split_last().filter(|_| self.config.learn_rate) {
            Some((rate, softness)) => (softness, self.problem.optimizer(rate.exp())),
            None => (phi, self.problem.optimizer(self.solve.learning_rate)),
        }
    }

    /// What draws under a softness, the latest one kept.
    fn renderer(&self, phi: &[f64]) -> Rc<ScheduledRenderer> {
        let mut latest = self.renderer.borrow_mut();
        match latest.as_ref().filter(|(of, _)| of == phi) {
            Some((_, renderer)) => renderer.clone(),
            None => {
                let rasterizer =
                    Rasterizer { tolerance: self.tolerance, ..Rasterizer::new(self.solve.size) };
                let (layout, faces) = (self.layout.clone(), self.problem.faces());
                let renderer =
                    ScheduledRenderer::new(layout, phi, rasterizer, Resolution::Full, faces);
                let renderer = Rc::new(renderer);
                *latest = Some((phi.to_vec(), renderer.clone()));
                renderer
            }
        }
    }

    /// The instance of a seed, with the inner loss as the outer one if `own`, else by what the configuration says.
    fn made(&self, seed: u64, phi: &[f64], own: bool) -> InstanceProblem<P, B> {
        let (softness, optimizer) = self.parted(phi);
        let (problem, renderer) = (&self.problem, self.renderer(softness));
        let instance = problem.instance(seed).expect("instances of all seeds can be made");
        let instance = std::slice::from_ref(&instance);
        let finer = if own { 1 } else { self.config.finer() };
        let outer_scene = problem.scene(instance, finer * self.solve.size);
        let start = problem.start::<Autodiff<B>>(&outer_scene).inner();
        let image = match (&self.sharp, own) {
            (_, true) => OuterImage::Inner(renderer.clone()),
            (Some(sharp), false) => OuterImage::Sharp(sharp.clone()),
            (None, false) => OuterImage::Hard,
        };
        BilevelProblem {
            objective: Inner {
                problem: problem.clone(),
                scene: problem.scene(instance, self.solve.size),
                renderer,
                backend: PhantomData,
            },
            outer_loss: Outer { problem: problem.clone(), scene: outer_scene, image },
            inner: InnerLoop { optimizer, steps: self.solve.steps },
            start,
            outer_steps: self.config.outer_steps,
        }
    }

    /// The outer loss of a whole run.
    fn outer_loss(&self, seed: u64, phi: &Tensor<B, 1>, own: bool) -> f64 {
        let phi = numbers(phi.clone());
        let (softness, _) = self.parted(&phi);
        self.made(seed, &phi, own).loss(&vector(softness))
    }

    fn is_own(&self) -> bool {
        self.config.outer_loss == Some(OuterLoss::Own)
    }
}

/// A narrow logistic for all problems alike.
///
/// Judged by a softness that is being learned, wide ones flatter themselves.
fn sharp<P: InverseProblem>(problem: &P, size: usize, config: &LearnConfig) -> ScheduledRenderer {
    let pixels = match config.outer_loss {
        Some(OuterLoss::Pixels) => NEARLY_HARD_PX,
        _ => SHARP_PX,
    };
    let logistic = EdgeSoftness { family: Family::Logistic, squared: false };
    let softness = ScheduledSoftness::constant(logistic, pixels * 2.0 / size as f64);
    let layout = PhiLayout::new(softness, problem.own_phi(), 0, size);
    let phi = layout.start();
    let (rasterizer, faces) = (Rasterizer::new(size), problem.faces());
    ScheduledRenderer::new(layout, &phi, rasterizer, Resolution::Full, faces)
}

type InstanceProblem<P, B> = BilevelProblem<B, Inner<P, B>, Outer<P, B>, Adam>;

impl<P: InverseProblem, B: RasterBackend> TaskDistribution<B> for Instances<P, B> {
    type Objective = Inner<P, B>;
    type OuterLoss = Outer<P, B>;
    type Optimizer = Adam;

    fn problem(&self, seed: u64, phi: &Tensor<B, 1>) -> InstanceProblem<P, B> {
        self.made(seed, &numbers(phi.clone()), self.is_own())
    }

    fn loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.outer_loss(seed, phi, self.is_own())
    }

    /// Never by the inner loss, which the softness could flatter.
    fn validation_loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.outer_loss(seed, phi, false)
    }
}

/// What the inner loop lowers.
pub struct Inner<P: InverseProblem, B: RasterBackend> {
    problem: Rc<P>,
    scene: P::Scene<Autodiff<Autodiff<B>>>,
    renderer: Rc<ScheduledRenderer>,
    backend: PhantomData<B>,
}

type Twice<B> = Autodiff<Autodiff<B>>;

impl<P: InverseProblem, B: RasterBackend> Inner<P, B> {
    fn loss_by(
        &self,
        theta: Tensor<Twice<B>, 1>,
        softness: &SoftnessAt<'_, Twice<B>>,
    ) -> Tensor<Twice<B>, 1> {
        inner_loss(&*self.problem, &self.scene, theta, softness)
    }
}

impl<P: InverseProblem, B: RasterBackend> Objective<Twice<B>> for Inner<P, B> {
    fn loss(&self, theta: Tensor<Twice<B>, 1>, phi: Tensor<Twice<B>, 1>) -> Tensor<Twice<B>, 1> {
        self.loss_at(theta, phi, self.renderer.layout().steps())
    }

    fn loss_at(
        &self,
        theta: Tensor<Twice<B>, 1>,
        phi: Tensor<Twice<B>, 1>,
        step: usize,
    ) -> Tensor<Twice<B>, 1> {
        let tracked = phi.is_require_grad() || phi.clone().inner().is_require_grad();
        // What the renderer was made for, it draws from tables that it keeps.
        let kept = !tracked && self.renderer.is_of(&phi);
        let softness = if kept { self.renderer.at(step) } else { self.renderer.tracked(step, phi) };
        self.loss_by(theta, &softness)
    }

    fn prepared(&self, phi: Tensor<Twice<B>, 1>, step: usize) -> Tensor<Twice<B>, 1> {
        self.renderer.prepare(&phi, step)
    }

    fn stage(&self, step: usize) -> usize {
        self.renderer.layout().stage(step)
    }

    fn loss_from(
        &self,
        theta: Tensor<Twice<B>, 1>,
        prepared: Tensor<Twice<B>, 1>,
        step: usize,
    ) -> Tensor<Twice<B>, 1> {
        self.loss_by(theta, &self.renderer.of_prepared(step, prepared))
    }

    fn allowed(&self, theta: Tensor<Twice<B>, 1>) -> Tensor<Twice<B>, 1> {
        self.problem.allowed(&self.scene, theta)
    }
}

/// The outer loss: how far the result of an inner loop is from its target.
pub struct Outer<P: InverseProblem, B: RasterBackend> {
    problem: Rc<P>,
    scene: P::Scene<Autodiff<B>>,
    image: OuterImage,
}

enum OuterImage {
    /// By a sharp soft image.
    Sharp(Rc<ScheduledRenderer>),
    /// By the hard image.
    Hard,
    /// By the loss at the last step, under the softness itself.
    Inner(Rc<ScheduledRenderer>),
}

impl<P: InverseProblem, B: RasterBackend> Objective<Autodiff<B>> for Outer<P, B> {
    fn loss(
        &self,
        theta: Tensor<Autodiff<B>, 1>,
        phi: Tensor<Autodiff<B>, 1>,
    ) -> Tensor<Autodiff<B>, 1> {
        let Self { problem, scene, image } = self;
        let image = match image {
            OuterImage::Sharp(sharp) => problem.sharp_image(scene, theta, &sharp.at(0)),
            OuterImage::Hard => problem.hard_image(scene, theta),
            OuterImage::Inner(renderer) => {
                let softness = renderer.tracked(renderer.layout().steps(), phi);
                return inner_loss(&**problem, scene, theta, &softness);
            }
        };
        problem.image_loss(scene, image).sum()
    }
}

/// What an inner loop lowers, `[1]`.
fn inner_loss<P: InverseProblem, B: RasterBackend>(
    problem: &P,
    scene: &P::Scene<B>,
    theta: Tensor<B, 1>,
    softness: &SoftnessAt<'_, B>,
) -> Tensor<B, 1> {
    let image = problem.image(scene, theta.clone(), softness);
    let loss = problem.image_loss(scene, image);
    let loss = match problem.regularizer(scene, theta) {
        Some(regularizer) => loss + regularizer,
        None => loss,
    };
    loss.sum()
}
