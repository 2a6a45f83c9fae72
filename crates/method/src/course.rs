use std::{cell::RefCell, marker::PhantomData, path::Path, sync::Arc};

use anyhow::Context;
use burn::{
    backend::{Autodiff, NdArray},
    tensor::Tensor,
};
use serde_json::{Value, json};
use softrast_meta::{
    Adam, Checkpoint, InnerLoop, Learner, Measured, MetaGradient, Objective, Problem, Progress,
    Tasks, Validation,
};
use softrast_raster::RasterBackend;
use softrast_runner::{Judged, Learned, Order, OuterStep, Plan, Referee, Study};

use crate::{Lesson, Of, Step, finer, numbers, tensor};

/// What learning computes on: floats of 32 bits, as in the runs that `evaluate` makes.
type Learning = NdArray<f32>;

/// Largest norm of the mean meta-gradient. Source: META 2.4.
const CLIP: f64 = 1.0;
/// Validations during a run, beside that of the start.
const VALIDATIONS: usize = 10;

/// Learns a softness as `plan` says.
///
/// # Errors
///
/// If an instance cannot be made.
pub fn study(lesson: impl Lesson, plan: &Plan) -> anyhow::Result<Box<dyn Study>> {
    lesson.suits(plan)?;
    // What would fail later fails here, where an error can be told.
    let seeds = (0..(plan.outer * plan.batch) as u64).map(|k| plan.seed + k);
    let last = seeds.max().into_iter().chain([plan.validation_seed]);
    last.map(|seed| lesson.scene::<Learning>(seed, 1)).collect::<Result<Vec<_>, _>>()?;
    let validation = Validation {
        seed: plan.validation_seed,
        count: plan.validation_runs,
        every: plan.outer.div_ceil(VALIDATIONS),
        patience: plan.patience,
    };
    let learner = Learner {
        mode: meta_gradient(plan),
        optimizer: Adam::new(plan.outer_rate),
        clip: CLIP,
        steps: plan.outer,
        batch: plan.batch,
        seed: plan.seed,
        validation,
    };
    let class = Class::new(lesson, plan);
    let progress = Progress::new(class.start());
    Ok(Box::new(Course { class, learner, progress }))
}

/// How `learn` takes the gradient that a plan asks for.
pub fn meta_gradient(plan: &Plan) -> MetaGradient {
    match plan.order {
        Order::Unrolled => MetaGradient::default(),
        Order::Truncated(steps) => MetaGradient::Truncated { steps, clip: Some(1.0) },
        Order::Direct => MetaGradient::Direct,
        Order::Joint => MetaGradient::Joint { learning_rate: plan.outer_rate },
        Order::Es(sigma) => MetaGradient::Es { sigma, pairs: 1 },
    }
}

struct Course<L: Lesson> {
    class: Class<L, Learning>,
    learner: Learner,
    progress: Progress,
}

impl<L: Lesson> Study for Course<L> {
    fn identity(&self) -> Value {
        json!({ "learner": self.learner, "start": self.class.start() })
    }

    fn advance(&mut self) -> anyhow::Result<Option<OuterStep>> {
        let Some(record) = self.learner.advance(&self.class, &mut self.progress)? else {
            return Ok(None);
        };
        let (loss, validation) = (record.loss, record.validation_loss);
        let record_json = serde_json::to_value(&record)?;
        Ok(Some(OuterStep { step: record.step, loss, validation, record: record_json }))
    }

    fn save(&self, path: &Path, job: &str) -> anyhow::Result<()> {
        Checkpoint { job: job.to_owned(), progress: self.progress.clone() }.save(path)?;
        Ok(())
    }

    fn resume(&mut self, path: &Path, job: &str) -> anyhow::Result<usize> {
        self.progress = Checkpoint::load(path, job)?;
        // The record of the last step, after which there is no update, is on file too.
        Ok(self.progress.step + usize::from(self.progress.finished))
    }

    fn learned(&self, note: &str) -> anyhow::Result<Learned> {
        let Progress { best, seconds, tried, dropped, .. } = &self.progress;
        let best = best.as_ref().map(|best| (best.step, best.loss));
        let loss = best.map(|(step, loss)| format!("; validation loss {loss:.6} after {step}"));
        let note = format!("{note}{}; {seconds:.0} s", loss.unwrap_or_default());
        let phi = self.progress.best_phi();
        let lesson = &self.class.lesson;
        let (softness, optimizer) = self.class.parted(phi);
        let files = lesson.files(softness, optimizer.learning_rate, &note);
        Ok(Learned {
            files: files.context("the learned softness")?,
            figures: lesson.figures(softness),
            parameters: phi.len(),
            best,
            seconds: *seconds,
            instances: [*tried, *dropped],
        })
    }
}

/// Instances of a lesson by seed, for a learner or a meta-gradient on a backend.
pub struct Class<L: Lesson, B: RasterBackend> {
    lesson: Arc<L>,
    own_referee: bool,
    /// Whether the last entry of φ is the logarithm of the inner learning rate.
    learns_rate: bool,
    finer: usize,
    measured: Measured,
    /// The latest φ and what was prepared for it.
    prepared: RefCell<Option<Prepared<L>>>,
    backend: PhantomData<B>,
}

/// A vector φ and what was prepared for it.
type Prepared<L> = (Vec<f64>, Arc<<L as Lesson>::Drawing>);

impl<L: Lesson, B: RasterBackend> Class<L, B> {
    /// The lesson with the referee that `plan` asks for.
    pub fn new(lesson: L, plan: &Plan) -> Self {
        let measured = match plan.judged {
            Judged::End => Measured::End,
            Judged::Quarters => Measured::Quarters,
        };
        let (own_referee, finer) = (plan.referee == Referee::Own, finer(plan));
        let (lesson, prepared) = (Arc::new(lesson), RefCell::new(None));
        let (learns_rate, backend) = (plan.learn_rate, PhantomData);
        Self { lesson, own_referee, learns_rate, finer, measured, prepared, backend }
    }

    /// φ that learning starts from.
    fn start(&self) -> Vec<f64> {
        let rate = self.learns_rate.then(|| self.lesson.inner().optimizer.learning_rate.ln());
        self.lesson.start().into_iter().chain(rate).collect()
    }

    /// The part of φ that is the softness, and what steps the inner loop.
    fn parted<'a>(&self, phi: &'a [f64]) -> (&'a [f64], Adam) {
        let usual = self.lesson.inner().optimizer;
        match phi.split_last().filter(|_| self.learns_rate) {
            Some((rate, softness)) => (softness, Adam { learning_rate: rate.exp(), ..usual }),
            None => (phi, usual),
        }
    }

    fn drawing(&self, phi: &[f64]) -> Arc<L::Drawing> {
        let mut prepared = self.prepared.borrow_mut();
        match prepared.as_ref().filter(|(of, _)| of == phi) {
            Some((_, drawing)) => drawing.clone(),
            None => {
                let drawing = Arc::new(self.lesson.prepare(phi));
                *prepared = Some((phi.to_vec(), drawing.clone()));
                drawing
            }
        }
    }

    fn made(&self, seed: u64, phi: &[f64], own_referee: bool) -> ProblemOf<L, B> {
        let (softness, optimizer) = self.parted(phi);
        let (lesson, drawing) = (&self.lesson, self.drawing(softness));
        let made = "its neighbours could be made";
        let objective = Inner {
            lesson: lesson.clone(),
            drawing: drawing.clone(),
            one: lesson.scene(seed, 1).expect(made),
            two: lesson.scene(seed, 1).expect(made),
        };
        let finer = if own_referee { 1 } else { self.finer };
        let referee = Outer {
            lesson: lesson.clone(),
            own: own_referee.then_some(drawing),
            zero: lesson.scene(seed, finer).expect(made),
            one: lesson.scene(seed, finer).expect(made),
        };
        let start = lesson.theta(&referee.zero);
        let inner = InnerLoop { optimizer, ..lesson.inner() };
        Problem { objective, referee, inner, start, measured: self.measured }
    }

    /// The outer loss of a whole run.
    fn lost(&self, seed: u64, phi: &Tensor<B, 1>, own_referee: bool) -> f64 {
        let phi = numbers(phi.clone());
        let (softness, _) = self.parted(&phi);
        let softness = tensor(softness.to_vec(), [softness.len()]);
        self.made(seed, &phi, own_referee).loss(&softness)
    }
}

/// An instance of a lesson.
type ProblemOf<L, B> = Problem<B, Inner<L, B>, Outer<L, B>, Adam>;

impl<L: Lesson, B: RasterBackend> Tasks<B> for Class<L, B> {
    type Objective = Inner<L, B>;
    type Referee = Outer<L, B>;
    type Optimizer = Adam;

    fn problem(&self, seed: u64, phi: &Tensor<B, 1>) -> ProblemOf<L, B> {
        self.made(seed, &numbers(phi.clone()), self.own_referee)
    }

    fn loss(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.lost(seed, phi, self.own_referee)
    }

    /// Always by the fixed referee.
    fn judged(&self, seed: u64, phi: &Tensor<B, 1>) -> f64 {
        self.lost(seed, phi, false)
    }
}

/// What the inner loop lowers.
pub struct Inner<L: Lesson, B: RasterBackend> {
    lesson: Arc<L>,
    drawing: Arc<L::Drawing>,
    one: L::Scene<Autodiff<B>>,
    two: L::Scene<Autodiff<Autodiff<B>>>,
}

/// What judges the result: the lesson's judge, or its own loss at the last step.
pub struct Outer<L: Lesson, B: RasterBackend> {
    lesson: Arc<L>,
    own: Option<Arc<L::Drawing>>,
    zero: L::Scene<B>,
    one: L::Scene<Autodiff<B>>,
}

/// One objective on several backends, each with its own scene.
macro_rules! objectives {
    ($backend:ty, $scene:ident, $tracked:expr) => {
        impl<L: Lesson, B: RasterBackend> Objective<$backend> for Inner<L, B> {
            fn loss(
                &self,
                theta: Tensor<$backend, 1>,
                phi: Tensor<$backend, 1>,
            ) -> Tensor<$backend, 1> {
                self.loss_at(theta, phi, self.lesson.inner().steps)
            }

            fn loss_at(
                &self,
                theta: Tensor<$backend, 1>,
                phi: Tensor<$backend, 1>,
                step: usize,
            ) -> Tensor<$backend, 1> {
                let tracked: fn(&Tensor<$backend, 1>) -> bool = $tracked;
                let of = if tracked(&phi) { Of::Phi } else { Of::Values };
                self.lesson.loss(&self.$scene, &self.drawing, theta, phi, Step { number: step, of })
            }

            fn prepared(&self, phi: Tensor<$backend, 1>, step: usize) -> Tensor<$backend, 1> {
                self.lesson.prepared(&self.drawing, phi, step)
            }

            fn stage(&self, step: usize) -> usize {
                self.lesson.stage(step)
            }

            fn loss_from(
                &self,
                theta: Tensor<$backend, 1>,
                prepared: Tensor<$backend, 1>,
                step: usize,
            ) -> Tensor<$backend, 1> {
                let step = Step { number: step, of: Of::Prepared };
                self.lesson.loss(&self.$scene, &self.drawing, theta, prepared, step)
            }

            fn allowed(&self, theta: Tensor<$backend, 1>) -> Tensor<$backend, 1> {
                self.lesson.allowed(&self.$scene, theta)
            }
        }
    };
}

/// One judge on several backends, each with its own scene.
macro_rules! judges {
    ($backend:ty, $scene:ident) => {
        impl<L: Lesson, B: RasterBackend> Objective<$backend> for Outer<L, B> {
            fn loss(
                &self,
                theta: Tensor<$backend, 1>,
                phi: Tensor<$backend, 1>,
            ) -> Tensor<$backend, 1> {
                let scene = &self.$scene;
                match &self.own {
                    None => self.lesson.judge(scene, theta),
                    Some(drawing) => {
                        let number = self.lesson.inner().steps;
                        let step = Step { number, of: Of::Phi };
                        self.lesson.loss(scene, drawing, theta, phi, step)
                    }
                }
            }
        }
    };
}

// On the lower level a joint loop alone asks for the derivative by φ; on the higher one φ belongs to a
// tape below.
objectives!(Autodiff<B>, one, Tensor::is_require_grad);
objectives!(Autodiff<Autodiff<B>>, two, |_| true);
judges!(B, zero);
judges!(Autodiff<B>, one);
