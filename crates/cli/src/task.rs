use image::RgbImage;
use serde_json::{Map, Value};
use softrast_inverse::{InverseProblem, Iterate};
use softrast_lab::{Metric, Role, plot::Plot, rgb_from_gray};
use softrast_raster::{HostBackend, ImageSize};
use softrast_softness::Family;
use softrast_tensor::Tensor;

use crate::{Answer, Common, Entry, Given, MethodArgs, Paper, Scales, Schedule, Variant};

/// An [`InverseProblem`] with a program: its name, its flags, and the measurement and display of results.
pub trait Task: InverseProblem + Sized {
    /// Name of the task, of its program and of the default output folder, such as `pose`.
    const NAME: &'static str;

    /// Name of the program, if it has more than one task.
    const PROGRAM: &'static str = Self::NAME;

    /// The kind of learned softness that is the default, as `learned-KIND` on the command line;
    /// `None` for the task's own preset, if there is one.
    const PRESET: Option<&'static str> = None;

    /// Name in the paper, such as `POSE`.
    const TITLE: &'static str;

    /// One line for the head of `--help` and of the report, without a full stop.
    const ABOUT: &'static str;

    /// Default scales of its softness.
    const SCALES: Scales;

    /// Whether edges move: only then can images be drawn at lower resolution and tolerance, and a surrogate is useful.
    const MOVES_EDGES: bool = true;

    /// The paper's numbers, if it has the task.
    const PAPER: &'static Paper = &Paper::NONE;

    /// Hard errors above this justify another start.
    const RESTART_ABOVE: f64 = f64::INFINITY;

    /// Flags of this task only; [`NoArgs`] for none.
    type Args: clap::Args + Clone;

    /// Flags of `solve` for the user's pictures; [`NoArgs`] for none.
    type Pictures: clap::Args + Clone;

    /// The answer for the pictures that the flags name; `None` if they name none. [`Given::will_write`] is called before the work.
    fn solve_given(
        _given: &Given<'_, Self::Args>,
        _pictures: &Self::Pictures,
    ) -> Option<anyhow::Result<Answer>> {
        None
    }

    /// The task in a variant. `edges` determine choices that follow from the softness of edges, such as that of depths.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`](softrast_lab::Error::Usage) for a wrong command line (exit code 2); any other error, such as an
    /// unreadable file, has exit code 1. The message is printed as one line and should state the remedy.
    fn new(args: &Self::Args, variant: Variant, edges: &EdgeChoice) -> anyhow::Result<Self>;

    /// The task and the method of the flags: [`Entry::new`], called here so that the steps are
    /// compiled once, in the crate of the task, and not in every program that runs it.
    ///
    /// # Errors
    ///
    /// If flags contradict each other or a file cannot be used.
    fn entry(args: &Self::Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry>;

    /// The measures of the task.
    fn measures() -> Measures;

    /// The description in the results.
    fn description(&self) -> Description;

    /// Name of the method in the results, if the task has its own softness too.
    fn method_name(&self, edges: &str) -> String {
        edges.to_owned()
    }

    /// Whether a method's own learning rate applies to this variant; else the variant's is used.
    fn takes_learning_rate(&self) -> bool {
        true
    }

    /// Number of instances to solve together.
    fn batch_size(&self) -> usize {
        1
    }

    /// Number of starts of a run: for one instance, or for many by a protocol.
    fn starts(_args: &Self::Args, _one_instance: bool) -> usize {
        1
    }

    /// Errors of each instance: that of the parameters, then the further ones and the gains, as named by [`Task::measures`].
    fn errors(
        &self,
        instances: &[Self::Instance],
        scene: &Self::Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>>;

    /// Whether a run with these returned errors is a success: that of the hard image, then those of [`Task::errors`].
    fn is_success(&self, hard: f64, errors: &[f64]) -> bool;

    /// The target hard images of all instances, one after the other.
    fn targets(&self, scene: &Self::Scene<HostBackend>) -> Vec<f64>;

    /// An image of an instance as a picture; by default in grey levels.
    fn picture(&self, image: &[f64], size: ImageSize) -> RgbImage {
        rgb_from_gray(image, size.width, size.height)
    }

    /// Whether it has a [`drawing`](Task::drawing).
    const DRAWS: bool = false;

    /// The result as an SVG drawing; by default `None`. `theta` is that of the instance.
    fn drawing(&self, _scene: &Self::Scene<HostBackend>, _theta: &[f64]) -> Option<String> {
        None
    }

    /// An image of an instance as a frame of the animation, with its target.
    fn frame(&self, image: &[f64], _target: &[f64], size: ImageSize) -> RgbImage {
        self.picture(image, size)
    }

    /// Warnings about a run whose numbers are not valid, a line each.
    fn warnings(&self, _run: &Ended<'_, Self>) -> Vec<String> {
        Vec::new()
    }

    /// A parameter of the task for `search` to vary, unless the flags fix it.
    fn own_axis(&self, _args: &Self::Args) -> Option<OwnAxis<Self::Args>> {
        None
    }

    /// The scales that `search` tries, out of those around the task's.
    fn searched_scales(around: Vec<f64>) -> Vec<f64> {
        around
    }

    /// Subdivisions of the mesh for `choose` to try, unless the flags fix it.
    fn detail(&self, _args: &Self::Args) -> Option<Detail<Self::Args>> {
        None
    }

    /// The file of the task's own learned softness: name and text.
    ///
    /// # Errors
    ///
    /// If the parameters are not valid in a file.
    fn own_file(
        &self,
        _phi: &[f64],
        _note: &str,
    ) -> anyhow::Result<Option<(&'static str, String)>> {
        Ok(None)
    }

    /// The task's own learned softness next to that of the start: a chart and its caption.
    fn own_chart(&self, _start: &[f64], _learned: &[f64]) -> Option<(Plot, &'static str)> {
        None
    }
}

/// The requested softness of edges.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EdgeChoice {
    /// A family.
    pub family: Option<Family>,
    /// Name of the requested bundled softness; [`PRESET`](crate::PRESET) for the preset of the task.
    pub bundled: Option<String>,
    /// The requested schedule of its scale.
    pub schedule: Option<Schedule>,
}

/// A [`Task::Args`] without flags.
#[derive(clap::Args, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoArgs {}

/// Names and units of the measures of a task.
#[derive(Clone, Copy, Debug)]
pub struct Measures {
    /// Error of the soft image.
    pub soft: &'static str,
    /// Error of the hard image.
    pub hard: &'static str,
    /// Name and unit of the error of the optimised parameters.
    pub parameter: [&'static str; 2],
    /// Further errors: key, name and unit.
    pub further: &'static [[&'static str; 3]],
    /// Measures that are better the higher they are: key, name and unit.
    pub gains: &'static [[&'static str; 3]],
}

/// Indices of the metrics of every task.
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

/// Description of a task, for the results.
#[derive(Clone, Debug)]
pub struct Description {
    /// Faces of the scene.
    pub faces: usize,
    /// Default number of seeds of `evaluate`.
    pub runs: usize,
    /// Criterion of success, as a clause: `the camera ends within 5 degrees`.
    pub success: String,
    /// All settings of the task that determine the numbers.
    pub settings: Map<String, Value>,
}

/// The end of a run.
pub struct Ended<'a, T: Task> {
    /// Its seed.
    pub seed: u64,
    /// Its instance.
    pub instance: &'a T::Instance,
    /// The target hard image.
    pub target: &'a [f64],
    /// Shorter side of the image, in pixels.
    pub size: usize,
    /// Error of the returned hard image.
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

/// Values of the task's flag for the subdivision of its mesh, the coarsest first.
pub struct Detail<A> {
    /// The flag without dashes.
    pub flag: &'static str,
    /// The values.
    pub values: Vec<usize>,
    /// Sets the flag.
    pub set: fn(&mut A, usize),
}

/// θ of each of this many instances.
pub fn theta_of(theta: &Tensor<HostBackend, 1>, instances: usize) -> Vec<Vec<f64>> {
    let values = softrast_tensor::numbers(theta.clone());
    values.chunks((values.len() / instances).max(1)).map(<[_]>::to_vec).collect()
}
