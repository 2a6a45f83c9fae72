//! The flags of all tasks.

use std::{fmt, path::PathBuf, str::FromStr};

use clap::{Args, Parser, ValueEnum};
use serde::{Deserialize, Serialize};
use softrast_inverse::{NameOrFile, Resolution};
use softrast_lab::{
    found,
    parse::{count, positive, seed, share, whole},
};
use softrast_softness::Family;

/// Heading of flags that apply to runs on seeds only, not to pictures.
pub const EXPERIMENTS: &str = "Experiments";
/// Heading of rarely needed flags.
pub(crate) const RARE: &str = "Rarely needed";

/// The problem, and the folder for results.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct Common {
    /// Folder for the results; created if missing [default: out/TASK, or out/TASK-COMMAND]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// The variant that a softness is tuned on, or the one it is transferred to
    #[arg(long, value_enum, default_value = "original", help_heading = EXPERIMENTS)]
    pub variant: Variant,

    /// Optimisation steps
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub steps: Option<usize>,

    /// Shorter side of the image, in pixels; images are square, except for shape2d --target
    #[arg(long, value_name = "N", value_parser = whole::<1, 4096>, allow_negative_numbers = true)]
    pub size: Option<usize>,

    /// Seed of the run, or the first of several
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = seed, allow_negative_numbers = true, help_heading = EXPERIMENTS)]
    pub seed: u64,

    /// Print one JSON object instead of the summary
    #[arg(long)]
    pub json: bool,

    /// Show no progress
    #[arg(long)]
    pub quiet: bool,

    /// Compute on ndarray, flex, wgpu or cuda, if the program was built with it
    #[arg(long, value_name = "NAME", help_heading = RARE)]
    pub backend: Option<String>,
}

impl Default for Common {
    fn default() -> Self {
        usual_args()
    }
}

/// A number above 0 and at most 1.
fn share_or_all(text: &str) -> Result<f64, String> {
    let number = positive(text).ok().filter(|&x| x <= 1.0);
    number.ok_or_else(|| "expected a number above 0 and at most 1".into())
}

/// The defaults of all flags.
///
/// # Panics
/// If a flag of `A` has no default, an error in the program.
pub fn usual_args<A: Args>() -> A {
    let command = A::augment_args(clap::Command::new("task"));
    let parsed = A::from_arg_matches(&command.get_matches_from(["task"]));
    parsed.unwrap_or_else(|error| panic!("every flag has a default: {error}"))
}

/// The method: a softness, the schedule of its scale, and the resolution. `None` is the task's default.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct MethodArgs {
    /// A family such as logistic, gauss, exp, gamma or mlp, a file, preset, learned[-KIND], searched, or auto
    #[arg(long, value_name = "NAME|FILE.json", help_heading = "Softness")]
    pub softness: Option<SoftnessChoice>,

    /// Width of the soft edge, in NDC
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true, help_heading = "Softness")]
    pub scale: Option<f64>,

    /// Width at the last step of a decay
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true, help_heading = "Softness")]
    pub scale_end: Option<f64>,

    /// Whether the width is fixed or falls geometrically
    #[arg(long, value_enum, help_heading = "Softness")]
    pub schedule: Option<Schedule>,

    /// Learning rate of the optimiser
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true, help_heading = "Softness")]
    pub learning_rate: Option<f64>,

    /// Learning rate at the last step as a share of the first, reached geometrically; 1 for a constant rate
    #[arg(long, value_name = "SHARE", value_parser = share_or_all, allow_negative_numbers = true, help_heading = RARE)]
    pub rate_end: Option<f64>,

    /// Use the squared distance as the softness's input; widths are then in NDC²
    #[arg(long, help_heading = RARE)]
    pub squared: bool,

    /// Surrogate gradient: that of the same softness at this width; it moves along with --scale
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true, help_heading = RARE)]
    pub surrogate_scale: Option<f64>,

    /// Weights of an mlp: random, or fitted to the logistic or to the given file
    #[arg(long, value_enum, help_heading = RARE)]
    pub init: Option<Init>,

    /// Pixels a side to optimise on: full, as few as the softness allows (auto), or a number
    #[arg(long, value_name = "full|auto|N", help_heading = RARE)]
    pub resolution: Option<Resolution>,

    /// Largest error of a pixel from culling distant faces [default: 1e-5, or 1e-2 in a decay]
    #[arg(long, value_name = "X", value_parser = share, allow_negative_numbers = true, help_heading = RARE)]
    pub tolerance: Option<f64>,
}

/// The two variants of every task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// The variant that a softness is tuned on
    Original,
    /// The variant that a tuned softness must also work on
    Transfer,
}

impl Variant {
    /// Both variants.
    pub const ALL: [Self; 2] = [Self::Original, Self::Transfer];

    /// Name on the command line and in the results.
    pub fn name(self) -> &'static str {
        match self {
            Variant::Original => "original",
            Variant::Transfer => "transfer",
        }
    }
}

/// Schedule of the scale over a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Schedule {
    /// Fixed
    Static,
    /// Geometrically from --scale to --scale-end
    Decay,
}

/// Weights of an untrained MLP softness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Init {
    /// Random, as in the paper
    Uniform,
    /// Fitted to another softness
    Fitted,
}

/// A softness as named on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SoftnessChoice {
    /// A family.
    Family(Family),
    /// A file, not opened yet.
    File(PathBuf),
    /// The default of the task, learned or searched.
    Preset,
    /// The bundled softness learned on the task, or that of this kind.
    Learned(Option<String>),
    /// The bundled softness of a search with more freedom than families have.
    Searched,
    /// The result of `choose`.
    Auto,
}

/// Name of the preset of a task.
pub const PRESET: &str = "preset";

/// Name of the searched softness of a task.
const SEARCHED: &str = "searched";

/// Beginning of the names of bundled learned softnesses.
const LEARNED: &str = "learned";

impl fmt::Display for SoftnessChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Family(family) => family.fmt(f),
            Self::File(path) => path.display().fmt(f),
            Self::Preset => f.write_str(PRESET),
            Self::Learned(None) => f.write_str(LEARNED),
            Self::Learned(Some(kind)) => write!(f, "{LEARNED}-{kind}"),
            Self::Searched => f.write_str(SEARCHED),
            Self::Auto => f.write_str("auto"),
        }
    }
}

impl FromStr for SoftnessChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(NameOrFile::Name(family)) => return Ok(Self::Family(family)),
            Ok(NameOrFile::File(path)) => return Ok(Self::File(path)),
            Err(_) => {}
        }
        match text.strip_prefix(LEARNED).map(|kind| (kind, kind.strip_prefix('-'))) {
            Some(("", _)) => return Ok(Self::Learned(None)),
            Some((_, Some(kind))) => return Ok(Self::Learned(Some(kind.to_owned()))),
            _ => {}
        }
        match text {
            PRESET => return Ok(Self::Preset),
            SEARCHED => return Ok(Self::Searched),
            "auto" => return Ok(Self::Auto),
            _ => {}
        }
        let families = Family::ALL.map(Family::name).join(", ");
        Err(format!(
            "expected preset, learned, searched, auto, a file that ends in .json, or one of {families}"
        ))
    }
}

impl MethodArgs {
    /// A method as one word of a command line: a softness, followed by its own flags.
    ///
    /// # Errors
    ///
    /// The mistake, in one line.
    pub fn parse(text: &str) -> Result<Self, String> {
        #[derive(Parser)]
        #[command(no_binary_name = true, disable_help_flag = true)]
        struct Line {
            #[command(flatten)]
            method: MethodArgs,
        }
        // A file name may contain spaces.
        let words: Vec<&str> = match text.parse::<SoftnessChoice>() {
            Ok(SoftnessChoice::File(_)) => vec![text],
            _ => text.split_whitespace().collect(),
        };
        let line = Line::try_parse_from(["--softness"].into_iter().chain(words));
        let mut method = line.map_err(|error| found(&error))?.method;
        method.reconcile()?;
        Ok(method)
    }

    /// This method as the second next to a first one: its scales are its own or the task's, never those of the first,
    /// where a scale may mean another width; its resolution and tolerance default to those of the first. A family also
    /// takes the learning rate of the first and its end; a file brings its own rate.
    #[must_use]
    pub fn with_defaults_of(self, first: &Self) -> Self {
        let is_family = matches!(self.softness, None | Some(SoftnessChoice::Family(_)));
        Self {
            learning_rate: self.learning_rate.or(first.learning_rate.filter(|_| is_family)),
            rate_end: self.rate_end.or(first.rate_end.filter(|_| is_family)),
            resolution: self.resolution.or(first.resolution),
            tolerance: self.tolerance.or(first.tolerance),
            ..self
        }
    }

    /// Completes flags that follow from others.
    pub(crate) fn reconcile(&mut self) -> Result<(), String> {
        match (self.schedule, self.scale_end) {
            (Some(Schedule::Static), Some(_)) => {
                Err("--scale-end needs --schedule decay, but --schedule static was given".into())
            }
            (None, Some(_)) => {
                self.schedule = Some(Schedule::Decay);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The requested schedule: a scale without a schedule is fixed.
    pub(crate) fn given_schedule(&self) -> Option<Schedule> {
        self.schedule.or(self.scale.map(|_| Schedule::Static))
    }

    /// Whether it sets scales, which a file has itself.
    pub(crate) fn is_scaled(&self) -> bool {
        self.scale.is_some() || self.scale_end.is_some() || self.squared
    }

    /// Whether it has no flag of the softness.
    pub(crate) fn is_silent(&self) -> bool {
        let moved = self.schedule.is_some() || self.surrogate_scale.is_some();
        self.softness.is_none() && !moved && self.init.is_none() && !self.is_scaled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_method_has_its_own_scales_and_shares_the_rest() {
        let first = MethodArgs::parse(
            "exp --scale 0.1 --surrogate-scale 1 --learning-rate 0.3 --rate-end 0.1",
        );
        let first = first.unwrap();
        let second = MethodArgs::parse("gauss").unwrap().with_defaults_of(&first);
        assert_eq!(second.softness, Some(SoftnessChoice::Family(Family::Gauss)));
        assert_eq!((second.scale, second.surrogate_scale), (None, None));
        assert_eq!(second.learning_rate, Some(0.3));
        // A file or bundled softness keeps its own learning rate.
        for name in ["preset", "learned.json"] {
            let own = MethodArgs::parse(name).unwrap().with_defaults_of(&first);
            assert_eq!((own.learning_rate, own.rate_end), (None, None), "{name}");
        }
        let second = MethodArgs::parse("mlp --scale-end 1e-3 --learning-rate 2").unwrap();
        let second = second.with_defaults_of(&first);
        assert_eq!((second.scale_end, second.learning_rate), (Some(1e-3), Some(2.0)));
        assert_eq!(second.schedule, Some(Schedule::Decay));
    }

    #[test]
    fn a_method_that_makes_no_sense_is_refused_in_a_line() {
        assert!(MethodArgs::parse("my softness.json").is_ok());
        let wrong = ["", "sofft", "gauss --scale 0", "gauss --steps 3", "gauss exp"];
        for wrong in wrong.into_iter().chain(["gauss --schedule static --scale-end 1e-3"]) {
            let message = MethodArgs::parse(wrong).err().unwrap_or_else(|| panic!("{wrong}"));
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }

    #[test]
    fn every_family_is_a_softness_and_is_read_as_it_is_written() {
        let others = ["preset", "learned", "learned-mlp", "auto", "a/b.json"];
        for name in Family::ALL.map(Family::name).into_iter().chain(others) {
            assert_eq!(name.parse::<SoftnessChoice>().unwrap().to_string(), name);
        }
        let message = "learn".parse::<SoftnessChoice>().unwrap_err();
        assert!(message.contains("gumbel_min"), "{message}");
    }
}
