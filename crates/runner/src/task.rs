use image::RgbImage;

use crate::{Error, Grid, Plan, Progress, Settings, Study};

/// A problem that the shared command line can solve and evaluate.
pub trait Task: Sized {
    /// Name of the binary and of the default output folder, such as `pose`.
    const NAME: &'static str;

    /// One line for the head of `--help` and of the report.
    const ABOUT: &'static str;

    /// Flags that only this task has; [`NoArgs`](crate::NoArgs) for none.
    type Args: clap::Args;

    /// Resolves the settings to everything a run needs: meshes, softness, defaults.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`](crate::Error::Usage) where the command line is at fault (exit code 2);
    /// anything else, such as a file that cannot be read, ends with exit code 1. The message
    /// becomes one line and should say what to do.
    fn prepare(settings: &Settings, args: &Self::Args) -> anyhow::Result<Self>;

    /// What the results should say about the prepared task.
    fn describe(&self) -> Description;

    /// How many instances one call of [`run`](Task::run) should solve together in `evaluate`.
    fn batch_size(&self) -> usize {
        1
    }

    /// The error by which `search` compares settings.
    fn score(&self) -> Score {
        Score::Image
    }

    /// What `search` tries where the command line does not say.
    ///
    /// By default a grid around the numbers `scale`, `scale_end` and `learning_rate` of
    /// [`Description::settings`], see [`Grid::around`].
    fn grid(&self) -> Grid {
        Grid::around(&self.describe().settings)
    }

    /// How finely the mesh may be divided, for `choose` to try; none if that is not free, as by default.
    fn detail(&self) -> Option<Detail> {
        None
    }

    /// Solves one instance for every seed of the batch, and returns them in the order of the seeds.
    ///
    /// A run depends on its seed alone, not on the others in its batch. Call
    /// [`Progress::step`] after every step, and pass its error on with `?`: that is how Ctrl-C
    /// ends a batch.
    ///
    /// # Errors
    ///
    /// Whatever keeps the batch from being solved. A value that stops being finite is no error:
    /// the results then end at the step before, with a warning.
    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>>;

    /// Prepares to learn a softness on instances of this task.
    ///
    /// # Errors
    ///
    /// If there is nothing to learn, as by default, or the settings do not go with learning.
    fn study(self, _plan: &Plan) -> anyhow::Result<Box<dyn Study>> {
        Err(Error::Usage(format!("{} has no softness to learn", Self::NAME)).into())
    }
}

/// A [`Task::Args`] without flags.
#[derive(clap::Args, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoArgs {}

/// Values of a flag of the task that say how finely its mesh is divided.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Detail {
    /// The flag without dashes, such as `triangles`.
    pub flag: &'static str,
    /// Values to try, the coarsest mesh first. The task finds the one to take in [`Settings::detail`].
    pub values: Vec<usize>,
    /// The one of them that it takes if nobody says.
    pub usual: usize,
}

/// Instances to solve together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Batch {
    /// One instance per seed; never empty.
    pub seeds: Vec<u64>,
    /// Whether the run of the first seed should bring its [`Pictures`].
    pub pictures: bool,
}

/// Most frames that an animation shows.
pub(crate) const FRAMES: usize = 80;

impl Batch {
    /// Whether the state after `step` of `steps` should become a frame of the animation.
    ///
    /// True for step 0, the last step and evenly spaced steps between, at most 80 in all; always
    /// false for a batch without pictures.
    pub fn wants_frame(&self, step: usize, steps: usize) -> bool {
        let frame = |step: usize| step * (FRAMES - 1) / steps.max(1);
        self.pictures && (step == 0 || frame(step) > frame(step - 1))
    }
}

/// What a prepared task is, for the results and the report.
#[derive(Clone, Debug)]
pub struct Description {
    /// Name of the softness, such as `logistic`, or the path of its file.
    pub softness: String,
    /// Length of the softness' parameter vector.
    pub parameters: usize,
    /// Name of the burn backend and its float type, such as `ndarray f64`.
    pub backend: String,
    /// Steps of one run.
    pub steps: usize,
    /// Width and height of the rendered image, in pixels.
    pub size: usize,
    /// Faces of the scene.
    pub faces: usize,
    /// How many seeds `evaluate` takes where `--runs` does not say.
    pub runs: usize,
    /// The error seen in the image.
    pub image_error: Measure,
    /// The error of what is optimised.
    pub parameter_error: Measure,
    /// Further errors, in the order of [`Point::extra`].
    pub extra: Vec<ExtraError>,
    /// When a run counts as a success, to follow that word: `the camera ends within 5 degrees`.
    pub success: String,
    /// Every resolved choice that decides the numbers, as a JSON object such as
    /// `{"learning_rate": 0.3, "schedule": "static"}`. It is copied into `result.json` and shown
    /// in the report, where `_` in a key reads as a space.
    pub settings: serde_json::Map<String, serde_json::Value>,
}

/// Name and unit of a measured quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Measure {
    /// Name as it stands on a chart axis, such as `camera angle`.
    pub name: &'static str,
    /// Unit, such as `degrees`; empty for a pure number.
    pub unit: &'static str,
}

impl Measure {
    /// Name with the unit, such as `camera angle (degrees)`.
    pub(crate) fn title(&self) -> String {
        match self.unit {
            "" => self.name.to_owned(),
            unit => format!("{} ({unit})", self.name),
        }
    }
}

/// An error beside the two that every task has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExtraError {
    /// The error it stands under in the results.
    pub group: ErrorGroup,
    /// Key in that group, such as `hard` for `image_error.hard`.
    pub key: &'static str,
    /// Name and unit.
    pub measure: Measure,
}

/// One of the errors that a task reports, by its value at the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Score {
    /// [`Description::image_error`].
    Image,
    /// [`Description::parameter_error`].
    Parameter,
    /// The first of [`Description::extra`] with this key.
    Extra(&'static str),
}

/// The two kinds of error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorGroup {
    /// Seen in the image.
    Image,
    /// Of what is optimised.
    Parameter,
}

/// One solved instance.
#[derive(Clone, Debug)]
pub struct Run {
    /// Seed of the instance.
    pub seed: u64,
    /// State at step 0, before anything moved, and after the steps that follow, the last included.
    pub curve: Vec<Point>,
    /// Whether the run reached what [`Description::success`] asks.
    pub success: bool,
    /// Wall time of each optimisation step of the whole batch, in seconds; without the drawing of
    /// frames.
    pub step_seconds: Vec<f64>,
    /// Pictures, where [`Batch::pictures`] asked for them and this run is the first.
    pub pictures: Option<Pictures>,
    /// What the user should know, one line each, such as an empty target.
    pub warnings: Vec<String>,
}

/// State of a run after some steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Steps made so far.
    pub step: usize,
    /// What the optimiser lowers.
    pub loss: f64,
    /// [`Description::image_error`].
    pub image_error: f64,
    /// [`Description::parameter_error`].
    pub parameter_error: f64,
    /// Scale of the softness, which a schedule may change.
    pub scale: f64,
    /// Further errors, in the order of [`Description::extra`].
    pub extra: Vec<f64>,
}

/// What a run looks like. All images have the same size.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// What the run should arrive at.
    pub target: RgbImage,
    /// Before the first step.
    pub start: RgbImage,
    /// After the last step.
    pub result: RgbImage,
    /// Target against result, as [`difference`](crate::difference()) draws it.
    pub difference: RgbImage,
    /// The steps for which [`Batch::wants_frame`] is true, in order.
    pub frames: Vec<RgbImage>,
}
