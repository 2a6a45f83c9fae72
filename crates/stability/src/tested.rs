use std::path::Path;

use anyhow::Context;
use serde_json::{Value, json};
use softrast_cli::{Common, MethodArgs, Schedule, SoftnessChoice, Task, Variant};
use softrast_inverse::{InverseProblem, Method, ScheduledSoftness, SolveConfig, minimize};
use softrast_lab::{Batch, Progress, Run};
use softrast_raster::low_level::Rasterizer;
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::numbers;

use crate::drawing::Single;

/// A softness under test.
#[derive(Clone, Debug, PartialEq)]
pub struct Tested {
    /// Name of the family, or `decay`.
    pub name: String,
    family: Family,
    /// Softness that replaces the family at every scale.
    file: Option<(SoftnessChoice, Box<ScheduledSoftness>)>,
    decays: bool,
}

/// First over last scale of a decay, where a case names one scale only.
const DECAY: f64 = 10.0;

/// Settings with which a case solves a task.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Original or transfer.
    pub variant: Variant,
    /// Pixels a side.
    pub size: usize,
    /// Steps; by default those of the task.
    pub steps: Option<usize>,
    /// Learning rate; by default that of the softness.
    pub learning_rate: Option<f64>,
    /// Scale, for a decay the last; by default that of the task.
    pub scale: Option<f64>,
    /// Number of seeds, from 0 on.
    pub runs: usize,
}

impl Tested {
    /// A family with fixed width.
    pub fn family(family: Family) -> Self {
        Self { name: family.name().into(), family, file: None, decays: false }
    }

    /// A logistic whose width decays over the steps.
    pub fn decay() -> Self {
        Self { name: "decay".into(), decays: true, ..Self::family(Family::Logistic) }
    }

    /// The five families of the paper with fixed width, and a logistic with decaying width.
    ///
    /// `mlp` is a softness file to test in place of the untrained network.
    ///
    /// # Errors
    ///
    /// If the file cannot be used.
    pub fn all(mlp: Option<&Path>) -> anyhow::Result<Vec<Self>> {
        let families = [Family::Logistic, Family::Gauss, Family::Exp, Family::Gamma, Family::Mlp];
        let mut all: Vec<Self> = families.map(Self::family).into();
        all.push(Self::decay());
        if let Some(path) = mlp {
            let file = ScheduledSoftness::load(path).context("--mlp")?;
            all[4].file = Some((SoftnessChoice::File(path.into()), Box::new(file)));
        }
        Ok(all)
    }

    /// Everything that determines the results of the method.
    pub(crate) fn identity(&self) -> Value {
        let file = self.file.as_ref().and_then(|(_, softness)| softness.text(Path::new("")).ok());
        json!({ "name": self.name, "file": file })
    }

    /// Whether the softness is a network.
    pub fn is_network(&self) -> bool {
        self.family == Family::Mlp
    }

    /// The softness at `scale`, in NDC; a decay begins at ten times that and ends there. A file keeps its own scale.
    pub fn at(&self, scale: f64) -> ScheduledSoftness {
        let edge = EdgeSoftness::new(self.family);
        match &self.file {
            Some((_, file)) => (**file).clone(),
            None if self.decays => ScheduledSoftness::decay(edge, DECAY * scale, scale),
            None => ScheduledSoftness::constant(edge, scale),
        }
    }

    /// Solves seeds of a task.
    ///
    /// # Errors
    ///
    /// Any error of the task.
    pub fn solve<T: Task>(&self, args: T::Args, config: &Config) -> anyhow::Result<Vec<Run>> {
        let family = SoftnessChoice::Family(self.family);
        let file = self.file.as_ref().map(|(file, _)| file.clone());
        let scale = config.scale.filter(|_| file.is_none());
        let method = MethodArgs {
            schedule: file.is_none().then_some(match self.decays {
                true => Schedule::Decay,
                false => Schedule::Static,
            }),
            softness: Some(file.unwrap_or(family)),
            scale: scale.map(|scale| if self.decays { DECAY * scale } else { scale }),
            scale_end: scale.filter(|_| self.decays),
            learning_rate: config.learning_rate,
            ..MethodArgs::default()
        };
        let common = Common {
            variant: config.variant,
            size: Some(config.size),
            steps: config.steps,
            ..Common::default()
        };
        let experiment = T::entry(&args, &common, &method)?.experiment;
        let seeds: Vec<u64> = (0..config.runs as u64).collect();
        let mut runs = Vec::with_capacity(seeds.len());
        for seeds in seeds.chunks(experiment.batch_size().max(1)) {
            let batch = Batch { seeds: seeds.to_vec(), pictures: false };
            runs.extend(experiment.run(&batch, &mut Progress::hidden())?);
        }
        Ok(runs)
    }
}

/// Result of a descent.
pub struct Descended {
    /// Loss of each hard image after each step.
    hard: Vec<Vec<f64>>,
    /// Parameters after each step.
    thetas: Vec<Vec<f64>>,
    /// Every loss and parameter.
    pub numbers: Vec<f64>,
}

/// Descends from given instances of a problem, all in one batch.
///
/// # Errors
///
/// If there is no instance.
pub fn descend<P: InverseProblem>(
    problem: &P,
    instances: &[P::Instance],
    softness: ScheduledSoftness,
    config: SolveConfig,
) -> anyhow::Result<Descended> {
    let tolerance = Some(Rasterizer::TOLERANCE);
    let method = Method { tolerance, ..Method::new("tested", softness) };
    let mut end = Descended { hard: Vec::new(), thetas: Vec::new(), numbers: Vec::new() };
    minimize::<P, Single>(problem, instances, &method, &config, |iterate, _| {
        let theta = numbers(iterate.theta.clone());
        end.numbers.extend(iterate.loss.iter().chain(&iterate.hard_loss).chain(&theta));
        end.hard.push(iterate.hard_loss.clone());
        end.thetas.push(theta);
        Ok(())
    })?;
    Ok(end)
}

impl Descended {
    /// The step after which the hard image of an instance is best; the last if several are equal.
    fn best_step(&self, instance: usize) -> usize {
        let last_best = |best: usize, step: usize| {
            if self.hard[step][instance] <= self.hard[best][instance] { step } else { best }
        };
        (0..self.hard.len()).fold(0, last_best)
    }

    /// Parameters of an instance at its best step: its share of the vector.
    pub fn best(&self, instance: usize) -> &[f64] {
        let theta = &self.thetas[self.best_step(instance)];
        let share = theta.len() / self.hard[0].len();
        &theta[instance * share..(instance + 1) * share]
    }

    /// Lowest loss of the hard image of an instance.
    pub fn lowest(&self, instance: usize) -> f64 {
        self.hard[self.best_step(instance)][instance]
    }

    /// Parameters after the last step.
    pub fn last(&self) -> &[f64] {
        self.thetas.last().map_or(&[], Vec::as_slice)
    }
}
