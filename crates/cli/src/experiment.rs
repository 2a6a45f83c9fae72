use std::rc::Rc;

use serde_json::{Map, Value, json};
use softrast_inverse::{Method, Minimization, Resolution, SolveConfig, Surrogate};
use softrast_lab::{Batch, Error, Experiment, Metric, Pictures, Point, Progress, Run, best_point};
use softrast_raster::{BackendChoice, HostBackend, ImageSize, RasterBackend, on_backend};
use softrast_softness::Softness;

use crate::{
    Common, Description, EdgeChoice, Entry, MethodArgs, SoftnessChoice, Task, Variant, backend,
    task::{Ended, HARD, PARAMETER, theta_of},
};

/// Most pixels of an image: those of the largest square.
const MOST_PIXELS: usize = 1 << 24;

/// A task with a method to solve it.
pub struct TaskExperiment<T: Task> {
    /// The task.
    pub task: Rc<T>,
    /// The method.
    pub method: Method,
    /// Size, steps and learning rate.
    pub solve: SolveConfig,
    /// The variant.
    pub variant: Variant,
    /// Description of the task.
    pub description: Description,
    backend: BackendChoice,
    starts: usize,
    name: String,
    metrics: Vec<Metric>,
}

impl<T: Task> TaskExperiment<T> {
    /// The task and the method of the flags.
    ///
    /// # Errors
    ///
    /// If flags contradict each other or a file cannot be used.
    pub fn new(
        args: &T::Args,
        common: &Common,
        method_args: &MethodArgs,
        purpose: Purpose,
    ) -> anyhow::Result<Self> {
        // Must precede the first tensor.
        let backend = backend(common.backend.as_deref())?;
        let preset_by_default = matches!(purpose, Purpose::Solving | Purpose::Evaluating);
        let mut method_args = method_args.clone();
        if let (true, true, Some(kind)) = (preset_by_default, method_args.is_silent(), T::PRESET) {
            method_args.softness = Some(SoftnessChoice::Learned(Some(kind.to_owned())));
        }
        let method_args = &method_args;
        let family = match method_args.softness {
            Some(SoftnessChoice::Family(family)) => Some(family),
            _ => None,
        };
        let bundled = method_args.bundled(T::NAME, preset_by_default).map(|bundled| bundled.name);
        let edges = EdgeChoice { family, bundled, schedule: method_args.schedule };
        let task = T::new(args, common.variant, &edges)?;
        let mut method = method_args.method(T::NAME, &T::SCALES, preset_by_default)?;
        if !T::MOVES_EDGES {
            reject_moving_edge_flags(method_args)?;
            method.softness.surrogate = None;
        }
        if task.faces().is_none() {
            if method_args.surrogate_scale.is_some() {
                return Err(Error::usage(
                    "colours have no gradient but their own: leave out --surrogate-scale",
                ));
            }
            method.softness.surrogate = None;
        }
        let of_family = matches!(method_args.softness, None | Some(SoftnessChoice::Family(_)));
        if purpose == Purpose::Learning && of_family && method_args.surrogate_scale.is_none() {
            method.softness.surrogate = None;
            method.name = method.softness.softness.family.name().to_owned();
        }
        let usual = task.defaults();
        let size = common.size.unwrap_or(usual.size);
        let image = task.image_size(size);
        if image.pixels() > MOST_PIXELS {
            return Err(Error::usage(format!(
                "--size {size} draws {image} pixels: at most {MOST_PIXELS} fit"
            )));
        }
        method.resolution.check(image).map_err(Error::usage)?;
        // With an adaptive schedule, the number of steps is tuned to the learning rate.
        let takes = task.takes_learning_rate() || method.softness.adaptive.is_some();
        let of_method = method.softness.learning_rate.filter(|_| takes);
        let learning_rate = method_args.learning_rate.or(of_method).unwrap_or(usual.learning_rate);
        let steps = common.steps.unwrap_or(usual.steps);
        Ok(Self {
            solve: SolveConfig { size, steps, learning_rate },
            variant: common.variant,
            description: task.description(),
            backend,
            starts: T::starts(args, purpose == Purpose::Solving),
            name: task.method_name(&method.name),
            metrics: T::measures().metrics(),
            task: Rc::new(task),
            method,
        })
    }

    /// Size of the images.
    pub fn image_size(&self) -> ImageSize {
        self.task.image_size(self.solve.size)
    }

    /// Parameters of the softness, the task's own included.
    pub fn parameters(&self) -> usize {
        self.method.softness.parameters() + self.task.own_phi().len()
    }

    /// All settings that determine the numbers, as in the results.
    pub fn settings(&self) -> Map<String, Value> {
        let (softness, size) = (&self.method.softness, self.solve.size);
        let mut settings = self.description.settings.clone();
        let mut set = |name: &str, value: Value| drop(settings.insert(name.into(), value));
        set("learning_rate", self.solve.learning_rate.into());
        if let Some(end) = softness.rate_end {
            set("rate_end", end.into());
        }
        if T::MOVES_EDGES {
            set("resolution", self.method.resolution.to_string().into());
            set("tolerance", self.method.tolerance().into());
        }
        if T::RESTART_ABOVE.is_finite() {
            set("starts", self.starts.into());
        }
        let schedule = match (softness.is_constant(), softness.adaptive) {
            (true, _) => "static",
            (false, None) => "decay",
            (false, Some(_)) => "adaptive",
        };
        set("schedule", schedule.into());
        set("squared", softness.softness.scale_is_squared().into());
        for (name, progress) in [("scale", 0.0), ("scale_end", 1.0)] {
            set(name, softness.scale_at(progress, size).into());
            if let Some(Surrogate { softness, phi }) = softness.surrogate_at(progress, size) {
                set("surrogate", softness.family.name().into());
                set(&format!("surrogate_{name}"), softness.scale(&phi).into());
            }
        }
        if let Some(note) = &softness.note {
            set("softness_note", note.as_str().into());
        }
        let image = self.image_size();
        if image != ImageSize::from(size) {
            set("image_size", image.to_string().into());
        }
        settings
    }

    /// The description in the results.
    pub fn about(&self) -> Map<String, Value> {
        let about = json!({
            "variant": self.variant.name(),
            "softness": self.name,
            "parameters": self.parameters(),
            "backend": self.backend.title(),
            "steps": self.solve.steps,
            "size": self.solve.size,
            "faces": self.description.faces,
            "settings": self.settings(),
        });
        about.as_object().cloned().unwrap_or_default()
    }

    /// Solves instances together from one start.
    fn solve_once(
        &self,
        instances: &[T::Instance],
        batch: &Batch,
        progress: &mut Progress,
    ) -> anyhow::Result<Vec<Solved>> {
        on_backend!(self.backend, B => self.solve_on::<B>(instances, batch, progress))
    }

    fn solve_on<B: RasterBackend>(
        &self,
        instances: &[T::Instance],
        batch: &Batch,
        progress: &mut Progress,
    ) -> anyhow::Result<Vec<Solved>> {
        let mut all: Vec<Solved> = Vec::new();
        let given = instances.to_vec();
        let run = Minimization::<T, B, &T>::new(&self.task, given, &self.method, &self.solve)?;
        let mut run = if batch.pictures { run.with_pictures() } else { run };
        while let Some(iterate) = run.next().transpose()? {
            let scene = run.scene();
            if all.is_empty() {
                let targets = self.task.targets(scene);
                let target = targets.chunks(targets.len() / instances.len());
                let solved =
                    |target: &[f64]| Solved { target: target.to_vec(), ..Solved::default() };
                all = target.map(solved).collect();
            }
            let thetas = theta_of(&iterate.theta, instances.len());
            let errors = self.task.errors(instances, scene, &iterate);
            assert_eq!(
                errors.len(),
                instances.len(),
                "Task::errors gives a list for each instance"
            );
            for (k, (solved, errors)) in all.iter_mut().zip(errors).enumerate() {
                let at = [iterate.loss[k], iterate.soft_loss[k], errors[0], iterate.scale];
                let values = [&at[..], &[iterate.hard_loss[k]], &errors[1..]].concat();
                solved.run.curve.push(Point { step: iterate.step, values });
                // The time of a step is split over the runs of the batch.
                let share = iterate.seconds.map(|time| time / instances.len() as f64);
                solved.run.step_seconds.extend(share);
                if iterate.restarts > solved.run.restarts.len() {
                    solved.run.restarts.push(iterate.step);
                }
                solved.theta.clone_from(&thetas[k]);
            }
            if let Some(image) = &iterate.image {
                let frame = batch.wants_frame(iterate.step, self.solve.steps);
                self.keep_picture(&mut all[0], scene, image, frame);
            }
            let loss = iterate.loss.iter().sum::<f64>() / iterate.loss.len() as f64;
            if iterate.step > 0 {
                progress.step(iterate.step, loss)?;
            }
        }
        Ok(all)
    }

    /// Stores an image as the result, if no earlier step had a lower hard error, and as a frame if requested.
    fn keep_picture(
        &self,
        solved: &mut Solved,
        scene: &T::Scene<HostBackend>,
        image: &[f64],
        frame: bool,
    ) {
        let size = self.image_size();
        let step = solved.run.curve.len() - 1;
        let best = best_point(&solved.run.curve, HARD).is_none_or(|best| best.step == step);
        let now = || self.task.picture(image, size);
        let pictures = solved.run.pictures.get_or_insert_with(|| Pictures {
            target: self.task.picture(&solved.target, size),
            start: now(),
            result: now(),
            frames: Vec::new(),
            drawing: None,
        });
        if best {
            pictures.result = now();
            pictures.drawing = self.task.drawing(scene, &solved.theta);
        }
        if frame {
            pictures.frames.push(self.task.frame(image, &solved.target, size));
        }
    }

    fn run_of(&self, seed: u64, instance: &T::Instance, solved: Solved) -> Run {
        let hard = solved.hard();
        let Solved { run, target, theta } = solved;
        let returned = best_point(&run.curve, HARD);
        let success = returned.is_some_and(|point| {
            let errors = [&[point.values[PARAMETER]], &point.values[HARD + 1..]].concat();
            self.task.is_success(hard, &errors)
        });
        let size = self.solve.size;
        let ended = Ended { seed, instance, target: &target, size, hard, theta: &theta };
        Run { seed, success, warnings: self.task.warnings(&ended), ..run }
    }
}

/// Purpose of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// One instance, solved as well as possible.
    Solving,
    /// Many instances, by the protocol of the task.
    Evaluating,
    /// Finding a method, starting from a family by default.
    Finding,
    /// Finding a method by learning: a family has a surrogate only if requested, regardless of search results.
    Learning,
}

impl Entry {
    /// The task `T` with the method of the flags.
    ///
    /// # Errors
    ///
    /// If flags contradict each other or a file cannot be used.
    pub fn new<T: Task>(
        args: &T::Args,
        common: &Common,
        method: &MethodArgs,
    ) -> anyhow::Result<Self> {
        let experiment = TaskExperiment::<T>::new(args, common, method, Purpose::Evaluating)?;
        Ok(Self {
            method: experiment.method.clone(),
            solve: experiment.solve,
            settings: experiment.settings(),
            faces: experiment.description.faces,
            experiment: Box::new(experiment),
        })
    }
}

impl<T: Task> Experiment for TaskExperiment<T> {
    fn name(&self) -> &str {
        &self.name
    }

    fn identity(&self) -> Value {
        let mut identity = self.about();
        identity.remove("parameters");
        identity.extend([
            ("version".to_owned(), env!("CARGO_PKG_VERSION").into()),
            ("task".to_owned(), T::NAME.into()),
            ("method".to_owned(), json!(self.method)),
            ("starts".to_owned(), self.starts.into()),
        ]);
        identity.into()
    }

    fn metrics(&self) -> &[Metric] {
        &self.metrics
    }

    fn steps(&self) -> usize {
        self.solve.steps
    }

    fn batch_size(&self) -> usize {
        if self.method.softness.adaptive.is_some() { 1 } else { self.task.batch_size() }
    }

    /// Tries further starts if the hard error is too large, and returns the result with the smallest.
    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>> {
        let instances = batch.seeds.iter().map(|&seed| self.task.instance(seed));
        let instances = instances.collect::<anyhow::Result<Vec<_>>>()?;
        let mut kept = self.solve_once(&instances, batch, progress)?;
        for start in 1..self.starts {
            let again = (0..kept.len()).filter(|&k| kept[k].hard() > T::RESTART_ABOVE);
            let again = again
                .filter_map(|k| Some((k, self.task.restart(&instances[k], start, self.starts)?)));
            let (places, others): (Vec<_>, Vec<_>) = again.unzip();
            if others.is_empty() {
                break;
            }
            for (k, other) in places.into_iter().zip(self.solve_once(&others, batch, progress)?) {
                if other.hard() < kept[k].hard() {
                    kept[k] = other;
                }
            }
        }
        let runs = kept.into_iter().enumerate().map(|(k, mut solved)| {
            solved.run.pictures = solved.run.pictures.filter(|_| k == 0);
            self.run_of(batch.seeds[k], &instances[k], solved)
        });
        Ok(runs.collect())
    }
}

/// One instance, solved from one start.
#[derive(Default)]
struct Solved {
    /// The run, without its seed and success.
    run: Run,
    target: Vec<f64>,
    /// Parameters after the last step.
    theta: Vec<f64>,
}

impl Solved {
    /// Hard error of the returned step, which needs no knowledge of the true answer.
    fn hard(&self) -> f64 {
        best_point(&self.run.curve, HARD).map_or(f64::INFINITY, |point| point.values[HARD])
    }
}

fn reject_moving_edge_flags(method: &MethodArgs) -> anyhow::Result<()> {
    let given = [
        (method.resolution.is_some_and(|given| given != Resolution::Full), "--resolution"),
        (method.tolerance.is_some(), "--tolerance"),
        (method.surrogate_scale.is_some(), "--surrogate-scale"),
    ];
    match given.iter().find(|(given, _)| *given) {
        None => Ok(()),
        Some((_, flag)) => Err(Error::usage(format!(
            "edges stay where they are here, and every pixel sees every face: leave out {flag}"
        ))),
    }
}
