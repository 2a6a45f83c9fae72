use std::{fmt, path::PathBuf};

use clap::{Args, Parser, ValueEnum};
use serde::Serialize;

use crate::{Error, Resolution, control::Control, plan::LearnFlags, resolution::resolution};

/// Everything on the command line of a task.
#[derive(Debug, Parser)]
pub(crate) struct CommandLine<A: Args> {
    /// What to do.
    #[arg(value_enum, default_value = "solve")]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) settings: Settings,
    #[command(flatten)]
    pub(crate) control: Control,
    #[command(flatten)]
    pub(crate) learning: LearnFlags,
    #[command(flatten)]
    pub(crate) args: A,
}

/// What a task binary can be asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Command {
    /// Solve one instance and show it.
    #[default]
    Solve,
    /// Solve many seeds and give means with confidence intervals.
    Evaluate,
    /// Find the best scale and learning rate on training seeds, then evaluate them on others.
    Search,
    /// Learn the softness on training seeds, by the gradient of what a whole run ends with.
    Learn,
    /// Find the simplest softness, the fewest pixels, the largest tolerance and the coarsest mesh that are
    /// as good as the best, on training seeds.
    Choose,
}

impl Command {
    /// Name on the command line and in the results.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Command::Solve => "solve",
            Command::Evaluate => "evaluate",
            Command::Search => "search",
            Command::Learn => "learn",
            Command::Choose => "choose",
        }
    }
}

/// Flags that all tasks have. `None` means that the task chooses, per variant if it likes.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct Settings {
    /// What is asked for: `solve` may try harder than the protocol of `evaluate` allows.
    #[arg(skip)]
    pub command: Command,

    /// The value that `search` tries for the flag of [`Grid::own`](crate::Grid::own).
    #[arg(skip)]
    pub own: Option<f64>,

    /// The value that `choose` tries for the flag of [`Task::detail`](crate::Task::detail).
    #[arg(skip)]
    pub detail: Option<usize>,

    /// Variant of the task: the one a softness is tuned on, or the one it is transferred to.
    #[arg(long, value_enum, default_value = "original")]
    pub variant: Variant,

    /// Softness: logistic, gauss, exp, gamma, bilogit, mlp, a softness file in JSON, learned for the best that
    /// comes with the program, learned-mlp for its network and learned-surrogate for a sharp image with a gradient of
    /// its own, learned-pose and the like for what was learned on another task, or auto for what `choose` finds.
    #[arg(long, value_name = "NAME|FILE.json", value_parser = softness)]
    pub softness: Option<SoftnessChoice>,

    /// Width of the soft edge, in NDC (NDC² with --squared); positive.
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub scale: Option<f64>,

    /// Scale at the last step of a decay; implies --schedule decay.
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub scale_end: Option<f64>,

    /// Whether the scale stays or falls geometrically from --scale to --scale-end.
    #[arg(long, value_enum)]
    pub schedule: Option<Schedule>,

    /// Feed the softness the squared distance.
    #[arg(long)]
    pub squared: bool,

    /// Take the gradient of the same softness at this scale instead, in the unit of --scale: a sharp
    /// image with a wide gradient, which is not the derivative of the image. Where the scale moves, this
    /// is its first, and keeps its ratio to it.
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub surrogate_scale: Option<f64>,

    /// What an mlp starts from: weights drawn at random, or fitted to the logistic that the other flags
    /// would give [default: uniform]; with a softness file or learned, fitted puts a network like it in its place.
    #[arg(long, value_enum)]
    pub init: Option<Init>,

    /// What to compute on: ndarray, flex or wgpu, if the program was built with it; the first of these by
    /// default.
    #[arg(long, value_name = "NAME")]
    pub backend: Option<String>,

    /// Optimisation steps.
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub steps: Option<usize>,

    /// Learning rate of the optimiser; positive.
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub learning_rate: Option<f64>,

    /// Width and height of the image, in pixels.
    #[arg(long, value_name = "N", value_parser = size, allow_negative_numbers = true)]
    pub size: Option<usize>,

    /// Pixels a side of the image that is optimised on: full for --size, --size halved any number of
    /// times, or auto for as few as the softness can tell apart at each step. Errors and pictures are
    /// always those of --size [default: full].
    #[arg(long, value_name = "full|auto|N", value_parser = resolution)]
    pub resolution: Option<Resolution>,

    /// Largest error of a pixel by leaving out faces that are far from it, below 1 [default: 1e-5 where the scale
    /// stays, 1e-2 where it moves].
    #[arg(long, value_name = "X", value_parser = share, allow_negative_numbers = true)]
    pub tolerance: Option<f64>,

    /// Seed of the run; `evaluate` and `search` take this one and those that follow.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = seed, allow_negative_numbers = true)]
    pub seed: u64,

    /// Number of seeds to evaluate on.
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub runs: Option<usize>,

    /// Folder for the results, `out` and the name of the task by default; made if missing.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Print one JSON object instead of the summary.
    #[arg(long)]
    pub json: bool,

    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
}

/// The two variants of every task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// The one a softness is tuned on.
    Original,
    /// The one a tuned softness must also work on.
    Transfer,
}

impl Variant {
    /// Name on the command line and in the results.
    pub fn name(self) -> &'static str {
        match self {
            Variant::Original => "original",
            Variant::Transfer => "transfer",
        }
    }
}

/// How the scale changes over a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Schedule {
    /// It does not.
    Static,
    /// Geometrically from `--scale` to `--scale-end`.
    Decay,
}

/// What the weights of an untrained MLP softness are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Init {
    /// Random, as in the paper.
    Uniform,
    /// Such that it is a logistic.
    Fitted,
}

/// A softness as named on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SoftnessChoice {
    /// One of [`SoftnessChoice::NAMES`].
    Named(&'static str),
    /// A file, not opened yet.
    File(PathBuf),
    /// One that was learned on the task and comes with the program: the best one, or the one of this
    /// name.
    Learned(Option<String>),
}

impl SoftnessChoice {
    /// The families that the command line knows.
    pub const NAMES: [&'static str; 6] = ["logistic", "gauss", "exp", "gamma", "bilogit", "mlp"];

    /// Stands for the method that `choose` finds; a task never sees it.
    pub(crate) const AUTO: Self = Self::Named("auto");
}

impl Default for Settings {
    /// What a command line without flags asks for.
    fn default() -> Self {
        #[derive(Parser)]
        struct Line {
            #[command(flatten)]
            settings: Settings,
        }
        Line::parse_from(["task"]).settings
    }
}

impl Settings {
    /// Checks what concerns several flags at once, and fills in what one flag says about another.
    pub(crate) fn reconcile(&mut self, command: Command) -> Result<(), Error> {
        self.command = command;
        match (self.schedule, self.scale_end) {
            (Some(Schedule::Static), Some(_)) => {
                return Err(Error::Usage(
                    "--scale-end needs --schedule decay, but --schedule static was given".into(),
                ));
            }
            (None, Some(_)) => self.schedule = Some(Schedule::Decay),
            _ => {}
        }
        let chooses = command == Command::Choose || self.softness == Some(SoftnessChoice::AUTO);
        if chooses && self.surrogate_scale.is_some() {
            return Err(Error::Usage(
                "--surrogate-scale does not go with choose or --softness auto, whose methods have none"
                    .into(),
            ));
        }
        match (command, self.runs) {
            (Command::Solve, Some(2..)) => Err(Error::Usage(
                "solve makes one run: ask for more with the command evaluate".into(),
            )),
            (Command::Learn, Some(_)) => Err(Error::Usage(
                "learn has no --runs: say --batch and --validation-runs, then evaluate what it learned"
                    .into(),
            )),
            (Command::Learn, _) if self.resolution.is_some() => Err(Error::Usage(
                "learn draws at --size: leave out --resolution".into(),
            )),
            _ => Ok(()),
        }
    }
}

/// Largest error of a pixel unless asked for another, where the scale stays or `moves`.
///
/// A scale that stays is narrow, and what reaches the pixels far from an edge is a gradient that nobody sees in the image
/// but that an optimiser follows. One that moves is wide first, when its near pixels tell as much, and is costly then.
pub const fn usual_tolerance(moves: bool) -> f64 {
    if moves { 1e-2 } else { 1e-5 }
}

/// What a softness that comes with the program is called, and with what its name begins.
const LEARNED: &str = "learned";

impl fmt::Display for SoftnessChoice {
    /// As on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(name) => f.write_str(name),
            Self::File(path) => path.display().fmt(f),
            Self::Learned(None) => f.write_str(LEARNED),
            Self::Learned(Some(kind)) => write!(f, "{LEARNED}-{kind}"),
        }
    }
}

pub(crate) fn softness(text: &str) -> Result<SoftnessChoice, String> {
    if text == "auto" {
        return Ok(SoftnessChoice::AUTO);
    }
    if text == LEARNED {
        return Ok(SoftnessChoice::Learned(None));
    }
    if let Some(name) = SoftnessChoice::NAMES.into_iter().find(|&name| name == text) {
        return Ok(SoftnessChoice::Named(name));
    }
    if text.to_ascii_lowercase().ends_with(".json") {
        return Ok(SoftnessChoice::File(text.into()));
    }
    if let Some(kind) = text.strip_prefix(LEARNED).and_then(|kind| kind.strip_prefix('-')) {
        return Ok(SoftnessChoice::Learned(Some(kind.to_owned())));
    }
    Err(format!(
        "expected one of {}, learned, auto or a file that ends in .json",
        SoftnessChoice::NAMES.join(", ")
    ))
}

pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if x > 0.0 && f64::is_finite(x) => Ok(x),
        _ => Err("expected a positive number".into()),
    }
}

/// More steps or runs than this are a slip of the finger.
const MOST: usize = 1_000_000;

pub(crate) fn count(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|n| (1..=MOST).contains(n));
    count.ok_or_else(|| format!("expected a whole number from 1 to {MOST}"))
}

/// Larger images would not fit into memory.
const LARGEST: usize = 4096;

pub(crate) fn size(text: &str) -> Result<usize, String> {
    let size = text.parse().ok().filter(|n| (1..=LARGEST).contains(n));
    size.ok_or_else(|| format!("expected a whole number of pixels from 1 to {LARGEST}"))
}

pub(crate) fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|&x| x > 0.0 && x < 1.0);
    share.ok_or_else(|| "expected a number above 0 and below 1".into())
}

fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| "expected a whole number from 0".into())
}
