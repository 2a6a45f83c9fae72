use image::RgbImage;
use serde_json::{Map, Value};
use softrast_inverse::{InverseProblem, Iterate};
use softrast_lab::{Metric, Role, plot::Plot, rgb_from_gray};
use softrast_raster::HostBackend;
use softrast_softness::Family;
use softrast_tensor::Tensor;

use crate::{Answer, Common, Entry, Given, MethodArgs, Paper, Scales, Schedule, Variant};

/// An [`InverseProblem`] that has a program: what it is called, which flags it has, how results are measured and shown.
pub trait Task: InverseProblem + Sized {
    /// Name of the task, of its program and of the default output folder, such as `pose`.
    const NAME: &'static str;

    /// Name of the program, where it does more than one task.
    const PROGRAM: &'static str = Self::NAME;

    /// The kind of learned softness that it takes where nobody says otherwise, as `learned-KIND` on the command line; none for a preset of
    /// its own, if there is one.
    const PRESET: Option<&'static str> = None;

    /// Name in the paper, such as `POSE`.
    const TITLE: &'static str;

    /// One line for the head of `--help` and of the report, without a full stop.
    const ABOUT: &'static str;

    /// Scales of its softness unless somebody says otherwise.
    const SCALES: Scales;

    /// Whether edges move: only then can images be drawn on fewer pixels and less exactly, and a surrogate has a use.
    const MOVES_EDGES: bool = true;

    /// Errors of hard images above this say that another start is worth its time.
    const RESTART_ABOVE: f64 = f64::INFINITY;

    /// Flags that only this task has; [`NoArgs`] for none.
    type Args: clap::Args + Clone;

    /// Flags of `solve` for pictures that the user gives; [`NoArgs`] where it takes none.
    type Pictures: clap::Args + Clone;

    /// What comes of the pictures that the flags name; nothing if they name none. [`Given::will_write`] is called before the work.
    fn solve_given(
        _given: &Given<'_, Self::Args>,
        _pictures: &Self::Pictures,
    ) -> Option<anyhow::Result<Answer>> {
        None
    }

    /// The task in a variant. `edges` are there for what follows from their softness, as that of depths.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`](softrast_lab::Error::Usage) where the command line is at fault (exit code 2); anything else, such as a file that
    /// cannot be read, ends with exit code 1. The message becomes one line and should say what to do.
    fn new(args: &Self::Args, variant: Variant, edges: &EdgeChoice) -> anyhow::Result<Self>;

    /// The task and the method that flags ask for: [`Entry::new`], called here so that the steps are compiled once, in the crate of the
    /// task, and not in every program that runs it.
    ///
    /// # Errors
    ///
    /// If flags contradict each other or a file cannot be used.
    fn entry(args: &Self::Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry>;

    /// What is measured.
    fn measures() -> Measures;

    /// What the results should say.
    fn description(&self) -> Description;

    /// What the method is called in the results, where the task has a softness of its own too.
    fn method_name(&self, edges: &str) -> String {
        edges.to_owned()
    }

    /// Whether the learning rate that was found with a method is for this variant; else the variant keeps its own.
    fn takes_learning_rate(&self) -> bool {
        true
    }

    /// How many instances to solve side by side.
    fn batch_size(&self) -> usize {
        1
    }

    /// Starts that a run may try: of `one_instance`, or of many by a protocol.
    fn starts(_args: &Self::Args, _one_instance: bool) -> usize {
        1
    }

    /// For each instance a list: the error of the parameters, then the further ones and the gains, as [`Task::measures`] names them.
    fn errors(
        &self,
        instances: &[Self::Instance],
        scene: &Self::Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>>;

    /// Whether a run succeeds that returns these errors: that of the hard image, then those of [`Task::errors`].
    fn is_success(&self, hard: f64, errors: &[f64]) -> bool;

    /// The hard images to arrive at, of all instances one after the other.
    fn targets(&self, scene: &Self::Scene<HostBackend>) -> Vec<f64>;

    /// An image of an instance as a picture; of grey levels unless the task draws it otherwise.
    fn picture(&self, image: &[f64], size: usize) -> RgbImage {
        rgb_from_gray(image, size, size)
    }

    /// Whether it has a [`drawing`](Task::drawing).
    const DRAWS: bool = false;

    /// What is found as a drawing, a file of SVG; none unless the task has one. `theta` is that of the instance.
    fn drawing(&self, _scene: &Self::Scene<HostBackend>, _theta: &[f64]) -> Option<String> {
        None
    }

    /// An image of an instance as a frame of the animation, with its target.
    fn frame(&self, image: &[f64], _target: &[f64], size: usize) -> RgbImage {
        self.picture(image, size)
    }

    /// What is wrong with a run, so that nobody trusts its numbers, a line each.
    fn warnings(&self, _run: &Ended<'_, Self>) -> Vec<String> {
        Vec::new()
    }

    /// A number of the task's own that `search` tries, unless the flags fix it.
    fn own_axis(&self, _args: &Self::Args) -> Option<OwnAxis<Self::Args>> {
        None
    }

    /// Scales that `search` tries, of those around the task's.
    fn searched_scales(around: Vec<f64>) -> Vec<f64> {
        around
    }

    /// How finely the mesh may be divided, for `choose` to try, unless the flags fix it.
    fn detail(&self, _args: &Self::Args) -> Option<Detail<Self::Args>> {
        None
    }

    /// The file of a learned softness of the task's own: name and text.
    ///
    /// # Errors
    ///
    /// If the parameters are not what a file may hold.
    fn own_file(
        &self,
        _phi: &[f64],
        _note: &str,
    ) -> anyhow::Result<Option<(&'static str, String)>> {
        Ok(None)
    }

    /// What a learned softness of the task's own looks like beside that of the start: a chart and its caption.
    fn own_chart(&self, _start: &[f64], _learned: &[f64]) -> Option<(Plot, &'static str)> {
        None
    }

    /// What the paper says of it, if it has the task.
    fn paper() -> &'static Paper {
        &Paper::NONE
    }
}

/// Which softness of edges was asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EdgeChoice {
    /// A family.
    pub family: Option<Family>,
    /// What comes with the program under this name; [`PRESET`](crate::PRESET) for the preset of the task.
    pub shipped: Option<String>,
    /// Whether its scale is to stay or fall.
    pub schedule: Option<Schedule>,
}

/// A [`Task::Args`] without flags.
#[derive(clap::Args, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoArgs {}

/// Names and units of what a task measures.
#[derive(Clone, Copy, Debug)]
pub struct Measures {
    /// Error of the soft image.
    pub soft: &'static str,
    /// Error of the hard image.
    pub hard: &'static str,
    /// Name and unit of the error of what is optimised.
    pub parameter: [&'static str; 2],
    /// Further errors: key, name and unit.
    pub further: &'static [[&'static str; 3]],
    /// What is the better the higher it is, likewise.
    pub gains: &'static [[&'static str; 3]],
}

/// Places of the metrics that every task has.
pub(crate) const SOFT: usize = 1;
pub(crate) const PARAMETER: usize = 2;
pub(crate) const SCALE: usize = 3;
pub(crate) const HARD: usize = 4;

impl Measures {
    /// All metrics: loss, soft error, error of the parameters, scale, hard error, further errors, gains.
    pub(crate) fn metrics(&self) -> Vec<Metric> {
        let metric = |key, [name, unit]: [&'static str; 2], role| Metric { key, name, unit, role };
        let mut metrics = vec![
            metric("loss", ["loss", ""], Role::Loss),
            metric("image_error", [self.soft, ""], Role::Error),
            metric("parameter_error", self.parameter, Role::Error),
            metric("scale", ["scale", ""], Role::Trace),
            metric("image_error.hard", [self.hard, ""], Role::Score),
        ];
        for (all, role) in [(self.further, Role::Error), (self.gains, Role::Gain)] {
            metrics.extend(all.iter().map(|&[key, name, unit]| metric(key, [name, unit], role)));
        }
        metrics
    }
}

/// What a task is, for the results.
#[derive(Clone, Debug)]
pub struct Description {
    /// Faces of the scene.
    pub faces: usize,
    /// How many seeds `evaluate` takes where nobody says.
    pub runs: usize,
    /// When a run counts as a success, to follow that word: `the camera ends within 5 degrees`.
    pub success: String,
    /// Every choice of the task that decides the numbers.
    pub settings: Map<String, Value>,
}

/// How a run ended.
pub struct Ended<'a, T: Task> {
    /// Its seed.
    pub seed: u64,
    /// What it was asked.
    pub instance: &'a T::Instance,
    /// The hard image to arrive at.
    pub target: &'a [f64],
    /// Width and height of the image, in pixels.
    pub size: usize,
    /// Error of the hard image that is returned.
    pub hard: f64,
    /// Parameters of the scene after the last step.
    pub theta: &'a [f64],
}

/// Values to try for a flag of the task.
pub struct OwnAxis<A> {
    /// The flag without dashes.
    pub flag: &'static str,
    /// Values, ascending and positive.
    pub values: Vec<f64>,
    /// Sets the flag.
    pub set: fn(&mut A, f64),
}

/// Values of the flag of a task that says how finely its mesh is divided, the coarsest first.
pub struct Detail<A> {
    /// The flag without dashes.
    pub flag: &'static str,
    /// The values.
    pub values: Vec<usize>,
    /// Sets the flag.
    pub set: fn(&mut A, usize),
}

/// θ of one of so many instances.
pub fn theta_of(theta: &Tensor<HostBackend, 1>, instances: usize) -> Vec<Vec<f64>> {
    let values = softrast_tensor::numbers(theta.clone());
    values.chunks((values.len() / instances).max(1)).map(<[_]>::to_vec).collect()
}
