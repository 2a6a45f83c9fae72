use std::path::Path;

use burn::backend::Autodiff;
use softrast_mesh::{Mesh, airplane, chair, icosphere};
use softrast_method::{Defaults, Method, numbers, study};
use softrast_raster::{RasterBackend, compiled_backends, on_backend};
use softrast_runner::{
    Batch, Description, Detail, ErrorGroup, ExtraError, Measure, Plan, Point, Progress, Run,
    Schedule, Score, Settings, Study, Task, Variant, best_step,
};

use crate::{
    Args, Chamfer, Instance, Scene,
    args::{DETAIL, DETAILS},
    instance::ELEVATIONS_DEG,
    lesson,
    picture::Album,
    scene::{DISTANCE, VIEWS},
    solve::{Solver, State},
};

/// A run succeeds when its hard `IoU` loss ends below this.
const SUCCESS: f64 = 0.3;

/// First and last scale of a decay, in NDC, and that of a static softness: wide enough at first to
/// keep parts from folding, and at last narrow for the sake of the hard silhouettes.
///
/// Measured with a logistic on our airplane, hard `IoU` loss at the last step, mean of the five
/// elevations: 0.101 for a decay from 0.03 to 0.003, 0.137 at 0.003 throughout. At elevation 30 alone:
/// 0.103 for a decay from 0.03 to 0.003, 0.104 to 0.002, 0.127 to 0.005 and 0.128 from 0.02 to 0.003;
/// without a decay 0.126 at 0.002, 0.104 at 0.003, 0.139 at 0.005, 0.172 at 0.007, 0.261 at 0.01 and 0.507
/// at 0.02. The decay also has the smaller Chamfer distance, 0.28 against 0.53 at 0.003.
const SCALES: Defaults = Defaults {
    task: Shape3d::NAME,
    schedule: Schedule::Decay,
    decay: [0.03, 0.003],
    fixed: 0.003,
    size: 64,
    backends: compiled_backends!(),
};

/// Largest move of a parameter in a step, roughly.
///
/// The middle of the three that the released script tries, 10^-1.25, 10^-1.5 and 10^-1.75 (FACTS 3.2).
/// At a scale of 0.003, hard `IoU` losses at elevation 30 end at 0.266, 0.104 and 0.161.
const LEARNING_RATE: f64 = 0.0316;

/// The prepared task.
pub struct Shape3d {
    pub(crate) target: Mesh,
    target_name: String,
    pub(crate) template: Mesh,
    template_name: String,
    /// The template was not asked for, but is there to be chosen.
    detail_is_free: bool,
    pub(crate) elevation_deg: Option<f64>,
    chamfer: Chamfer,
    pub(crate) solver: Solver,
}

impl Task for Shape3d {
    const NAME: &'static str = "shape3d";
    const ABOUT: &'static str = "Deforms a sphere until it has the silhouettes of a target";
    type Args = Args;

    fn prepare(settings: &Settings, args: &Args) -> anyhow::Result<Self> {
        let method = Method::new(settings, &SCALES)?;
        let suited = method.learning_rate();
        let learning_rate = settings.learning_rate.or(suited).unwrap_or(LEARNING_RATE);
        let solver = Solver {
            method,
            size: settings.size.unwrap_or(SCALES.size),
            steps: settings.steps.unwrap_or(100),
            learning_rate,
        };
        let (target, target_name) = target(settings.variant, args)?;
        let level = settings.detail.or(args.detail).unwrap_or(DETAIL);
        let (template, template_name) = match &args.template {
            None => (icosphere(level as u32), "sphere".to_owned()),
            Some(path) => (Mesh::load(path)?, name(path)),
        };
        let chamfer = Chamfer::new(target.positions(), target.faces());
        Ok(Self {
            target,
            target_name,
            template,
            template_name,
            detail_is_free: args.template.is_none() && args.detail.is_none(),
            elevation_deg: args.elevation,
            chamfer,
            solver,
        })
    }

    fn describe(&self) -> Description {
        let Solver { method, size, steps, learning_rate } = &self.solver;
        let settings = serde_json::json!({
            "mesh": self.target_name,
            "template": self.template_name,
            "vertices": self.template.positions().len(),
            "views": VIEWS,
            "elevations": self.elevation_deg.map_or(ELEVATIONS_DEG.to_vec(), |one| vec![one]),
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
            faces: self.template.faces().len(),
            runs: ELEVATIONS_DEG.len(),
            image_error: Measure { name: "soft IoU loss", unit: "" },
            parameter_error: Measure { name: "Chamfer distance", unit: "1e-3 squared units" },
            extra: EXTRA.to_vec(),
            success: format!("the hard IoU loss ends below {SUCCESS}"),
            settings: method.settings(*steps, settings),
        }
    }

    /// What can be seen of the result; the soft error of a method falls with its scale.
    fn score(&self) -> Score {
        Score::Extra("hard")
    }

    fn detail(&self) -> Option<Detail> {
        let detail = Detail { flag: "detail", values: DETAILS.to_vec(), usual: DETAIL };
        self.detail_is_free.then_some(detail)
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
        study(lesson::Shape3dLesson::new(self, plan), plan)
    }
}

/// Errors beside the soft image error and the Chamfer distance.
const EXTRA: [ExtraError; 1] = [ExtraError {
    group: ErrorGroup::Image,
    key: "hard",
    measure: Measure { name: "hard IoU loss", unit: "" },
}];

impl Shape3d {
    /// Solves the instance of `seed`, with pictures if the batch wants them.
    fn one<B: RasterBackend>(
        &self,
        batch: &Batch,
        seed: u64,
        progress: &mut Progress,
    ) -> anyhow::Result<Run> {
        let instance = Instance::seeded(seed, self.elevation_deg);
        let Solver { size, steps, .. } = self.solver;
        let scene = Scene::<Autodiff<B>>::new(&self.target, &self.template, &instance, size);
        let target = numbers(scene.target().inner());
        let mut album = batch.pictures.then(|| Album::new(&target, size));
        let mut curve: Vec<Point> = Vec::with_capacity(steps + 1);
        let mut step_seconds = Vec::with_capacity(steps);
        self.solver.run(&scene, batch.pictures, |state: State| {
            curve.push(Point {
                step: state.step,
                loss: state.loss,
                image_error: state.soft,
                parameter_error: self.chamfer.distance(&state.vertices, scene.faces()),
                scale: state.scale,
                extra: vec![state.hard],
            });
            if let (Some(album), Some(image)) = (&mut album, &state.image) {
                let image: Vec<f64> = image.iter().collect();
                album.take(&image, state.hard, batch.wants_frame(state.step, steps));
            }
            step_seconds.extend(state.seconds);
            if state.step == 0 { Ok(()) } else { progress.step(state.step, state.loss) }
        })?;
        let end = best_step(&curve, |point| point.extra[0]);
        let end = end.map_or(f64::INFINITY, |end| end.extra[0]);
        Ok(Run {
            seed,
            success: end < SUCCESS,
            warnings: self.warnings(seed, &target, end),
            curve,
            step_seconds,
            pictures: album.map(Album::pictures),
        })
    }

    /// What is wrong with an instance, so that nobody trusts its numbers.
    fn warnings(&self, seed: u64, target: &[f64], hard_at_end: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        let views = target.chunks(target.len() / VIEWS);
        let covered: Vec<f64> = views.map(|v| v.iter().sum::<f64>() / v.len() as f64).collect();
        let [empty, full] = [0.0, 1.0].map(|all| covered.iter().filter(|&&c| c == all).count());
        if empty > 0 {
            warnings.push(format!(
                "seed {seed}: {empty} of {VIEWS} target images are empty, so there is nothing to \
                 match in them: check that the mesh is around the origin (--normalize moves it \
                 there) and raise --size"
            ));
        }
        if full > 0 {
            warnings.push(format!(
                "seed {seed}: the mesh fills {full} of {VIEWS} target images, so no edge shows its \
                 shape in them: try --normalize or a larger --size"
            ));
        }
        let radius = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
        let radius = self.target.triangles().flatten().map(radius).fold(0.0, f64::max);
        if radius >= DISTANCE {
            warnings.push(format!(
                "seed {seed}: the target mesh reaches {radius:.3} from the origin, as far as the \
                 cameras at {DISTANCE}: try --normalize"
            ));
        }
        if empty < VIEWS && hard_at_end >= 1.0 {
            warnings.push(format!(
                "seed {seed}: the result covers nothing of the target, so nothing pulls it there: \
                 try a larger --scale or a smaller --learning-rate"
            ));
        }
        warnings
    }
}

/// The mesh to arrive at and its name.
fn target(variant: Variant, args: &Args) -> anyhow::Result<(Mesh, String)> {
    let (mesh, name) = match (&args.mesh, variant) {
        (Some(path), _) => (Mesh::load(path)?, name(path)),
        (None, Variant::Original) => (airplane(), "airplane".to_owned()),
        (None, Variant::Transfer) => (chair(), "chair".to_owned()),
    };
    if !args.normalize {
        return Ok((mesh, name));
    }
    let halved = mesh.normalized().positions().iter().map(|p| p.map(|x| 0.5 * x)).collect();
    Ok((Mesh::new(halved, mesh.faces().to_vec())?, format!("{name}, normalized")))
}

fn name(path: &Path) -> String {
    path.display().to_string()
}
