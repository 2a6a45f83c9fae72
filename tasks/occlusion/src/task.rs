use burn::backend::Autodiff;
use softrast_method::{Defaults, Method, numbers, study};
use softrast_raster::{RasterBackend, compiled_backends, on_backend};
use softrast_runner::{
    Batch, Description, Error, ErrorGroup, ExtraError, Grid, Measure, OwnAxis, Plan, Point,
    Progress, Resolution, Run, Schedule, Score, Settings, Study, Task, Variant,
};

use crate::{
    Args, DepthError, Instance, Problem, Scene,
    depth_method::DepthMethod,
    instance::{front, pairs},
    lesson,
    picture::Album,
    solve::{Solver, State},
};

/// Instances solved together in `evaluate`.
const BATCH: usize = 10;

/// First and last scale of a decaying edge, in NDC, and that of a static one: narrow, because edges
/// stay where they are, and wide ones only blur the image.
///
/// Success of 50 seeds with `evaluate --runs 50 --size 32 --scale X`, original and transfer: 100 and
/// 100 % at 0.0005 and at 0.002, 90 and 100 % at 0.005, 48 and 70 % at 0.02, where near quads bleed
/// over the background and over one another. At 64 pixels, `evaluate --runs 50` succeeds in 100 % of
/// runs (95 % interval from 93 %), and `evaluate --variant transfer --runs 200` in 100 % (from 98 %).
const SCALES: Defaults = Defaults {
    task: Occlusion::NAME,
    schedule: Schedule::Static,
    decay: [0.02, 0.0005],
    fixed: 0.0005,
    size: 64,
    backends: compiled_backends!(),
};

/// Widths of the soft depth that a search tries.
const DEPTH_SCALES: [f64; 4] = [0.05, 0.1, 0.2, 0.4];

/// The prepared task.
pub struct Occlusion {
    pub(crate) problem: Problem,
    pub(crate) solver: Solver,
    /// The width of the soft depth was not asked for, but is there to be chosen.
    depth_is_free: bool,
}

impl Task for Occlusion {
    const NAME: &'static str = "occlusion";
    const ABOUT: &'static str = "Finds which of several overlapping quads is in front";
    type Args = Args;

    fn prepare(settings: &Settings, args: &Args) -> anyhow::Result<Self> {
        // The transfer has to cross 3.5 world units in ten steps. Front quads found of 50 with
        // `evaluate --variant transfer --size 32 --learning-rate X`: 74 % at 0.2, 92 % at 0.35, 100 %
        // at 0.7 and at 1.4.
        if settings.resolution.is_some_and(|asked| asked != Resolution::Full)
            || settings.tolerance.is_some()
        {
            let message = "edges stay where they are here, and every pixel sees every quad: leave out \
                           --resolution and --tolerance";
            return Err(Error::Usage(message.into()).into());
        }
        if settings.surrogate_scale.is_some() {
            let message = "edges of occlusion stay where they are, so that no gradient goes through a \
                           surrogate: leave out --surrogate-scale";
            return Err(Error::Usage(message.into()).into());
        }
        let edge = Method::new(settings, &SCALES)?.without_surrogate();
        let suited = edge.learning_rate();
        let (steps, learning_rate) = match settings.variant {
            Variant::Original => (100, suited.unwrap_or(0.03)),
            Variant::Transfer => (10, 0.7),
        };
        let solver = Solver {
            edge,
            depth: DepthMethod::new(settings, args)?,
            size: settings.size.unwrap_or(SCALES.size),
            steps: settings.steps.unwrap_or(steps),
            learning_rate: settings.learning_rate.unwrap_or(learning_rate),
        };
        let depth_is_free = args.depth_scale.is_none() && solver.depth.scale.is_some();
        Ok(Self { problem: Problem::of(settings.variant), solver, depth_is_free })
    }

    fn describe(&self) -> Description {
        let Solver { edge, depth, size, steps, learning_rate } = &self.solver;
        let mut settings = serde_json::json!({
            "depth_softness": depth.name,
            "learning_rate": learning_rate,
            "background_weight": crate::BACKGROUND,
        });
        if let Some(scale) = depth.scale {
            settings["depth_scale"] = scale.into();
        }
        let softness = match edge.name() == depth.name {
            true => depth.name.clone(),
            false => format!("{} edges and {} depths", edge.name(), depth.name),
        };
        let success = match self.problem.front_only {
            false => "all quads end in the right order",
            true => "the front quad ends in front",
        };
        Description {
            softness,
            parameters: edge.parameters() + depth.phi.len(),
            backend: edge.backend().title().to_owned(),
            steps: *steps,
            size: *size,
            faces: self.problem.quads,
            runs: 50,
            image_error: Measure { name: "soft image MSE", unit: "" },
            parameter_error: Measure { name: "wrong depth order", unit: "of pairs" },
            extra: EXTRA.to_vec(),
            success: success.to_owned(),
            settings: edge.settings(*steps, settings),
        }
    }

    fn batch_size(&self) -> usize {
        BATCH
    }

    /// What can be seen of the result; the soft error of a method falls with its scale.
    fn score(&self) -> Score {
        Score::Extra("hard")
    }

    /// The edge of the task and a wider one, because edges stay where they are, and several depths.
    fn grid(&self) -> Grid {
        let around = Grid::around(&self.describe().settings);
        let own = OwnAxis { flag: "depth-scale", values: DEPTH_SCALES.to_vec() };
        let scales = around.scales.into_iter().skip(2).step_by(2).collect();
        Grid { scales, own: self.depth_is_free.then_some(own), ..around }
    }

    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>> {
        on_backend!(self.solver.edge.backend(), B => self.run_on::<B>(batch, progress))
    }

    fn study(self, plan: &Plan) -> anyhow::Result<Box<dyn Study>> {
        study(lesson::OcclusionLesson::new(self, plan), plan)
    }
}

/// Errors beside the soft image error and the order, in the order of [`point`].
const EXTRA: [ExtraError; 3] = [
    ExtraError {
        group: ErrorGroup::Image,
        key: "hard",
        measure: Measure { name: "hard image MSE", unit: "" },
    },
    ExtraError {
        group: ErrorGroup::Parameter,
        key: "front",
        measure: Measure { name: "wrong front quad", unit: "of runs" },
    },
    ExtraError {
        group: ErrorGroup::Parameter,
        key: "depth",
        measure: Measure { name: "mean depth error", unit: "world units" },
    },
];

fn point(state: &State, view: usize, instance: &Instance) -> Point {
    let error = DepthError::new(&state.depths[view], &instance.target);
    let wrong_front = f64::from(u8::from(!error.right_front));
    Point {
        step: state.step,
        loss: state.soft[view],
        image_error: state.soft[view],
        parameter_error: error.wrong_pairs,
        scale: state.scale,
        extra: vec![state.hard[view], wrong_front, error.distance],
    }
}

impl Occlusion {
    fn run_on<B: RasterBackend>(
        &self,
        batch: &Batch,
        progress: &mut Progress,
    ) -> anyhow::Result<Vec<Run>> {
        let instances: Vec<Instance> =
            batch.seeds.iter().map(|&seed| Instance::seeded(seed, &self.problem)).collect();
        let Solver { size, steps, .. } = self.solver;
        let scene = Scene::<Autodiff<B>>::new(&self.problem, &instances, size);
        let values = 3 * size * size;
        let targets = numbers(scene.target().inner());
        let mut album = Album::new(&targets[..values], size);
        let mut curves = vec![Vec::with_capacity(steps + 1); instances.len()];
        // Where the hard image of each view is best: that is what is returned.
        let mut best = vec![(f64::INFINITY, Vec::new()); instances.len()];
        let mut ends = Vec::new();
        let mut step_seconds = Vec::with_capacity(steps);
        self.solver.run(&scene, batch.pictures, |state: State| {
            for (view, curve) in curves.iter_mut().enumerate() {
                curve.push(point(&state, view, &instances[view]));
            }
            if let Some(image) = &state.image {
                let image: Vec<f64> = image.iter().take(values).collect();
                let frame = batch.wants_frame(state.step, steps);
                album.take(&image, state.step, state.hard[0], frame);
            }
            step_seconds.extend(state.seconds);
            let loss = state.soft.iter().sum::<f64>() / state.soft.len() as f64;
            let step = state.step;
            for ((best, depths), &hard) in best.iter_mut().zip(&state.depths).zip(&state.hard) {
                if hard <= best.0 || best.1.is_empty() {
                    *best = (hard, depths.clone());
                }
            }
            ends = state.depths;
            if step == 0 { Ok(()) } else { progress.step(step, loss) }
        })?;

        let mut pictures = batch.pictures.then(|| album.pictures());
        let runs = batch.seeds.iter().zip(curves).enumerate().map(|(view, (&seed, curve))| Run {
            seed,
            success: self.is_success(&DepthError::new(&best[view].1, &instances[view].target)),
            warnings: self.warnings(seed, &instances[view], &ends[view]),
            curve,
            step_seconds: step_seconds.clone(),
            pictures: pictures.take(),
        });
        Ok(runs.collect())
    }

    fn is_success(&self, error: &DepthError) -> bool {
        if self.problem.front_only { error.right_front } else { error.wrong_pairs == 0.0 }
    }

    /// What is wrong with an instance, so that nobody trusts its numbers.
    fn warnings(&self, seed: u64, instance: &Instance, end: &[f64]) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.solver.depth.contrast() < 1e-3 {
            warnings.push(format!(
                "the depth softness {} weighs all depths alike, so no image shows which quad is in \
                 front: try another --depth-scale",
                self.solver.depth.name
            ));
        }
        let nearest = front(&instance.target);
        let asked =
            |(i, j): (usize, usize)| !self.problem.front_only || i == nearest || j == nearest;
        let overlaps = instance.visible_overlaps(self.solver.size);
        let pairs = pairs(instance.quads.len());
        let counts: Vec<usize> = overlaps
            .into_iter()
            .zip(pairs)
            .filter(|&(_, pair)| asked(pair))
            .map(|(n, _)| n)
            .collect();
        let unseen = counts.iter().filter(|&&count| count == 0).count();
        if unseen > 0 {
            warnings.push(format!(
                "seed {seed}: the target does not show the order of {unseen} of {} pairs of quads: \
                 raise --size",
                counts.len()
            ));
        }
        // The start went through the float type of the backend.
        let stayed = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6;
        if instance.quads.len() > 1 && end.iter().zip(&instance.start).all(stayed) {
            warnings.push(format!(
                "seed {seed}: no quad moved, because no gradient reached a depth: try a larger \
                 --depth-scale"
            ));
        }
        warnings
    }
}
