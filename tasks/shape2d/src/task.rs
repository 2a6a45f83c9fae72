use std::path::PathBuf;

use burn::backend::Autodiff;
use softrast_method::{Defaults, Method, study};
use softrast_raster::{RasterBackend, compiled_backends, on_backend};
use softrast_runner::{
    Batch, Description, Detail, ErrorGroup, ExtraError, Measure, Pictures, Plan, Point, Progress,
    Run, Schedule, Score, Settings, Study, Task, Variant, best_step, difference, rgb_from_gray,
};

use crate::{
    Args, Instance, Logo, Scene, lesson,
    solve::{Solver, State},
    target::luminance,
};

/// A run succeeds when its hard mean squared error ends below this.
const SUCCESS: f64 = 0.02;

/// First and last scale of a decay, in NDC, and that of a static softness: a quarter of a pixel of
/// the default size, because triangles lie so densely that few need to be pulled from afar.
///
/// Measured with a logistic, hard mean squared error at the last step, seed 0. Letters: static 0.0028
/// at 0.0015, 0.0024 at 0.002, 0.0035 at 0.003 and 0.0078 at 0.005; with a decay to 0.002 0.0031 from
/// 0.01 and 0.0029 from 0.02 or 0.04, to 0.001 from 0.02 0.0034. Skyline: 0.0108 at 0.002, and 0.0156
/// with a decay to it from 0.02, which sees one white sheet at first.
const SCALES: Defaults = Defaults {
    task: Shape2d::NAME,
    schedule: Schedule::Static,
    decay: [0.02, 0.002],
    fixed: 0.002,
    size: 256,
    backends: compiled_backends!(),
};
/// Largest move of a coordinate in a step, roughly, in NDC: about a pixel of the default size.
///
/// Hard mean squared errors on the letters end at 0.0026 with 0.005, 0.0024 with 0.01 and 0.0034 with
/// 0.02.
const LEARNING_RATE: f64 = 0.01;

/// The prepared task.
pub struct Shape2d {
    pub(crate) target: Vec<f64>,
    target_name: String,
    pub(crate) triangles: usize,
    /// Numbers of triangles to choose from, if none was asked for.
    detail: Option<Detail>,
    pub(crate) source: Source,
    pub(crate) solver: Solver,
}

/// Where the picture comes from.
pub(crate) enum Source {
    Logo(Variant),
    File(PathBuf),
}

impl Source {
    /// The picture on `size` × `size` pixels, top row first, in [0, 1].
    pub(crate) fn image(&self, size: usize) -> anyhow::Result<Vec<f64>> {
        match self {
            Source::Logo(variant) => Ok(Logo::of(*variant).image(size)),
            Source::File(path) => luminance(path, size),
        }
    }
}

impl Task for Shape2d {
    const NAME: &'static str = "shape2d";
    const ABOUT: &'static str = "Moves loose triangles until they cover a picture";
    type Args = Args;

    fn prepare(settings: &Settings, args: &Args) -> anyhow::Result<Self> {
        let method = Method::new(settings, &SCALES)?;
        let suited = method.learning_rate();
        let learning_rate = settings.learning_rate.or(suited).unwrap_or(LEARNING_RATE);
        let solver = Solver {
            method,
            size: settings.size.unwrap_or(SCALES.size),
            steps: settings.steps.unwrap_or(200),
            learning_rate,
        };
        let (triangles, logo) = match settings.variant {
            Variant::Original => (800, "letters"),
            Variant::Transfer => (4000, "skyline"),
        };
        let (source, target_name) = match &args.target {
            None => (Source::Logo(settings.variant), logo.to_owned()),
            Some(path) => (Source::File(path.clone()), path.display().to_string()),
        };
        let target = source.image(solver.size)?;
        let detail = args.triangles.is_none().then(|| Detail {
            flag: "triangles",
            values: vec![triangles / 4, triangles / 2, triangles],
            usual: triangles,
        });
        let triangles = settings.detail.or(args.triangles).unwrap_or(triangles);
        Ok(Self { target, target_name, triangles, detail, source, solver })
    }

    fn describe(&self) -> Description {
        let Solver { method, size, steps, learning_rate } = &self.solver;
        let settings = serde_json::json!({
            "target": self.target_name,
            "learning_rate": learning_rate,
            "resolution": method.resolution().to_string(),
            "tolerance": method.rasterizer(*size).tolerance,
        });
        Description {
            softness: method.name().to_owned(),
            parameters: method.parameters(),
            backend: method.backend().title().to_owned(),
            steps: *steps,
            size: *size,
            faces: self.triangles,
            runs: 20,
            image_error: Measure { name: "soft MSE", unit: "" },
            parameter_error: Measure { name: "hard MSE (stands in)", unit: "" },
            extra: EXTRA.to_vec(),
            success: format!("the hard MSE ends below {SUCCESS}"),
            settings: method.settings(*steps, settings),
        }
    }

    /// What can be seen of the result; the soft error of a method falls with its scale.
    fn score(&self) -> Score {
        Score::Extra("hard")
    }

    fn detail(&self) -> Option<Detail> {
        self.detail.clone()
    }

    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>> {
        let first = batch.seeds.first().copied();
        let runs = batch.seeds.iter().map(|&seed| {
            let pictures = batch.pictures && Some(seed) == first;
            let batch = Batch { seeds: vec![seed], pictures };
            on_backend!(self.solver.method.backend(), B => self.one::<B>(&batch, seed, progress))
        });
        runs.collect()
    }

    fn study(self, plan: &Plan) -> anyhow::Result<Box<dyn Study>> {
        study(lesson::Shape2dLesson::new(self, plan)?, plan)
    }
}

/// Errors beside the soft image error and what stands in for that of the parameters.
const EXTRA: [ExtraError; 1] = [ExtraError {
    group: ErrorGroup::Image,
    key: "hard",
    measure: Measure { name: "hard MSE", unit: "" },
}];

impl Shape2d {
    /// Solves the instance of `seed`, with pictures if the batch wants them.
    fn one<B: RasterBackend>(
        &self,
        batch: &Batch,
        seed: u64,
        progress: &mut Progress,
    ) -> anyhow::Result<Run> {
        let Solver { size, steps, .. } = self.solver;
        let instance = Instance::seeded(seed, self.triangles);
        let scene = Scene::<Autodiff<B>>::new(&self.target, &instance, size);
        let mut curve: Vec<Point> = Vec::with_capacity(steps + 1);
        let mut step_seconds = Vec::with_capacity(steps);
        let mut shown = Vec::new();
        let (mut result, mut least) = (None, f64::INFINITY);
        self.solver.run(&scene, batch.pictures, |state: State| {
            curve.push(Point {
                step: state.step,
                loss: state.loss,
                image_error: state.soft,
                parameter_error: state.hard,
                scale: state.scale,
                extra: vec![state.hard],
            });
            let (frame, best) = (batch.wants_frame(state.step, steps), state.hard <= least);
            if let Some(image) = state.image.filter(|_| frame || best) {
                let image: Vec<f64> = image.iter().collect();
                let picture = rgb_from_gray(&image, size, size);
                if best {
                    (result, least) = (Some(picture.clone()), state.hard);
                }
                if frame {
                    shown.push(picture);
                }
            }
            step_seconds.extend(state.seconds);
            if state.step == 0 { Ok(()) } else { progress.step(state.step, state.loss) }
        })?;
        let pictures = match (shown.first().cloned(), result) {
            (Some(start), Some(result)) => {
                let target = rgb_from_gray(&self.target, size, size);
                let difference = difference(&target, &result);
                Some(Pictures { target, start, result, difference, frames: shown })
            }
            _ => None,
        };
        let end = best_step(&curve, |point| point.extra[0]);
        let end = end.map_or(f64::INFINITY, |end| end.extra[0]);
        Ok(Run {
            seed,
            success: end < SUCCESS,
            warnings: self.warnings(seed, end),
            curve,
            step_seconds,
            pictures,
        })
    }

    /// What is wrong with the picture or the run of `seed`, so that nobody trusts its numbers.
    fn warnings(&self, seed: u64, hard_at_end: f64) -> Vec<String> {
        let white = self.target.iter().filter(|&&p| p > 0.5).count();
        let black_image = self.target.iter().map(|p| p * p).sum::<f64>() / self.target.len() as f64;
        let warning = if white == 0 {
            "the target has nothing white, so the triangles can only vanish: give another --target \
             or raise --size"
                .to_owned()
        } else if white == self.target.len() {
            "the target has nothing black, so it shows no shape: give another --target or raise \
             --size"
                .to_owned()
        } else if hard_at_end >= black_image {
            format!(
                "seed {seed}: the triangles end no nearer to the target than an empty image: try a \
                 larger --scale or more --triangles"
            )
        } else {
            return Vec::new();
        };
        vec![warning]
    }
}
