use std::{cell::RefCell, marker::PhantomData, rc::Rc};

use softrast_meta::{Adam, BilevelProblem, InnerLoop, TaskDistribution};
use softrast_raster::{RasterBackend, low_level::Rasterizer};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Tensor, numbers, vector};

use crate::{
    Inner, InverseProblem, LearnConfig, Method, Outer, OuterLoss, PhiLayout, Resolution,
    ScheduledRenderer, ScheduledSoftness, SolveConfig, minimize, objectives::OuterImage,
};

/// Scale of the softness of the outer loss, in pixels of its image: the smallest one whose gradient
/// does not depend on the position of an edge between the pixels.
const SHARP_PX: f64 = 0.25;
/// Scale for [`OuterLoss::Pixels`], nearly hard: at a quarter of a pixel, edges through the centres
/// of pixels cost half of their cost in the hard image.
const NEARLY_HARD_PX: f64 = 0.05;
/// The distribution of instances that a softness is learned on: by seed, each solved with the settings `solve`.
///
/// ```
/// use softrast_inverse::{Instances, InverseProblem, LearnConfig, Method, PoseProblem, ScheduledSoftness, SolveConfig};
/// use softrast_mesh::icosphere;
/// use softrast_meta::TaskDistribution;
/// use softrast_raster::HostBackend;
/// use softrast_tensor::vector;
///
/// let problem = PoseProblem::new(&icosphere(0));
/// let solve = SolveConfig { size: 8, steps: 2, ..problem.defaults() };
/// let method = Method::new("learned", ScheduledSoftness::learned("pose")?);
/// let instances = Instances::<_, HostBackend>::new(problem, &method, &solve, &LearnConfig::default())?;
/// let phi = vector(&instances.start());
/// let [first, second, again] = [0, 1, 0].map(|seed| instances.loss(seed, &phi));
/// assert!(first == again && first != second);
/// # anyhow::Ok(())
/// ```
pub struct Instances<P: InverseProblem, B: RasterBackend, S = EdgeSoftness> {
    pub(crate) problem: Rc<P>,
    solve: SolveConfig,
    pub(crate) config: LearnConfig,
    pub(crate) layout: PhiLayout<S>,
    tolerance: f64,
    /// Image of the outer loss, if that does not depend on φ.
    judge: OuterImage<S>,
    /// Renderer under the latest φ.
    latest: RefCell<Option<Rc<ScheduledRenderer<S>>>>,
    backend: PhantomData<B>,
}

impl<P: InverseProblem, B: RasterBackend, S: Softness> Instances<P, B, S> {
    /// Instances of a problem, with the softness of `method` as start.
    ///
    /// # Errors
    ///
    /// If choices contradict each other.
    pub fn new(
        problem: P,
        method: &Method<S>,
        solve: &SolveConfig,
        config: &LearnConfig,
    ) -> anyhow::Result<Self> {
        let own = problem.own_phi();
        let config = config.resolved(&method.softness, own.len())?;
        let layout = PhiLayout::learned(&method.softness, own, solve.steps, solve.size, &config);
        let tolerance = match config.differentiates() {
            true => method.learning_tolerance(),
            false => method.tolerance(),
        };
        let judge = match config.outer_loss {
            Some(OuterLoss::Hard | OuterLoss::Returned) => OuterImage::Hard,
            _ => OuterImage::Sharp(sharp(&problem, config.finer() * solve.size, &config).into()),
        };
        let (problem, solve, latest) = (Rc::new(problem), *solve, RefCell::new(None));
        Ok(Self { problem, solve, config, layout, tolerance, judge, latest, backend: PhantomData })
    }

    /// φ at the start of learning, followed by the logarithm of the inner learning rate if that is learned.
    pub fn start(&self) -> Vec<f64> {
        let rate = self.config.learn_rate.then(|| self.solve.learning_rate.ln());
        self.layout.start().into_iter().chain(rate).collect()
    }

    /// The entries of φ that are the softness, and the optimiser of the inner loop.
    pub(crate) fn split_phi<'a>(&self, phi: &'a [f64]) -> (&'a [f64], Adam) {
        match phi.split_last().filter(|_| self.config.learn_rate) {
            Some((rate, softness)) => (softness, self.problem.optimizer(rate.exp())),
            None => (phi, self.problem.optimizer(self.solve.learning_rate)),
        }
    }

    /// The renderer under a softness; the latest one is cached.
    fn renderer(&self, phi: &[f64]) -> Rc<ScheduledRenderer<S>> {
        let mut latest = self.latest.borrow_mut();
        let kept = latest.take().filter(|renderer| renderer.phi() == phi);
        let renderer = kept.unwrap_or_else(|| {
            let full = Rasterizer::new(self.problem.image_size(self.solve.size));
            let rasterizer = Rasterizer { tolerance: self.tolerance, ..full };
            let (layout, faces) = (self.layout.clone(), self.problem.faces());
            ScheduledRenderer::new(layout, phi, rasterizer, Resolution::Full, faces).into()
        });
        latest.insert(renderer).clone()
    }

    /// The instance of a seed, with the inner loss as outer loss if `own`, else with the configured one.
    fn made(&self, seed: u64, phi: &[f64], own: bool) -> InstanceProblem<P, B, S> {
        let (softness, optimizer) = self.split_phi(phi);
        let (problem, renderer) = (&self.problem, self.renderer(softness));
        let instance = problem.instance(seed).expect("instances of all seeds can be made");
        let instance = std::slice::from_ref(&instance);
        let finer = if own { 1 } else { self.config.finer() };
        let outer_scene = problem.scene(instance, finer * self.solve.size);
        let start = problem.start::<Autodiff<B>>(&outer_scene).inner();
        let image = if own { OuterImage::Inner(renderer.clone()) } else { self.judge.clone() };
        BilevelProblem {
            objective: Inner {
                problem: problem.clone(),
                scene: problem.scene(instance, self.solve.size),
                renderer,
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
        if self.config.outer_loss == Some(OuterLoss::Returned) {
            return self.returned(seed, &phi).sqrt();
        }
        let (softness, _) = self.split_phi(&phi);
        self.made(seed, &phi, own).loss(&vector(softness))
    }

    /// The least hard error of a whole run; NaN if none is finite.
    fn returned(&self, seed: u64, phi: &[f64]) -> f64 {
        let (softness, Adam { learning_rate, .. }) = self.split_phi(phi);
        let (softness, _) = self.layout.softness(softness);
        let tolerance = Some(self.tolerance);
        let method = Method { tolerance, ..Method::new("learned", softness) };
        let instance = self.problem.instance(seed).expect("instances of all seeds can be made");
        let mut least = f64::NAN;
        let solve = SolveConfig { learning_rate, ..self.solve };
        minimize::<P, B>(&self.problem, &[instance], &method, &solve, |iterate, _| {
            least = least.min(iterate.hard_loss[0]);
            Ok(())
        })
        .expect("a run on the host has no errors of its own");
        least
    }

    fn is_own(&self) -> bool {
        self.config.outer_loss == Some(OuterLoss::Own)
    }
}

/// A narrow logistic, the same for all problems.
///
/// An outer loss under the learned softness would favour wide ones.
fn sharp<P: InverseProblem>(problem: &P, size: usize, config: &LearnConfig) -> ScheduledRenderer {
    let pixels = match config.outer_loss {
        Some(OuterLoss::Pixels) => NEARLY_HARD_PX,
        _ => SHARP_PX,
    };
    let logistic = EdgeSoftness::new(Family::Logistic);
    let softness = ScheduledSoftness::constant(logistic, pixels * 2.0 / size as f64);
    let layout = PhiLayout::new(softness, problem.own_phi(), 0, size);
    let phi = layout.start();
    let (rasterizer, faces) = (Rasterizer::new(problem.image_size(size)), problem.faces());
    ScheduledRenderer::new(layout, &phi, rasterizer, Resolution::Full, faces)
}

type InstanceProblem<P, B, S> = BilevelProblem<B, Inner<P, B, S>, Outer<P, B, S>, Adam>;

impl<P: InverseProblem, B: RasterBackend, S: Softness> TaskDistribution<B> for Instances<P, B, S> {
    type Objective = Inner<P, B, S>;
    type OuterLoss = Outer<P, B, S>;
    type Optimizer = Adam;

    fn problem(&self, seed: u64, phi: &Tensor<B, 1>) -> InstanceProblem<P, B, S> {
        self.made(seed, &numbers(phi.clone()), self.is_own())
    }

    fn loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.outer_loss(seed, phi, self.is_own())
    }

    /// Never the inner loss, which favours wide softnesses.
    fn validation_loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.outer_loss(seed, phi, false)
    }
}
