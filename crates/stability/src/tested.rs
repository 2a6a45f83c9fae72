use std::{ffi::OsString, path::PathBuf};

use clap::{Args, Parser};
use softrast_method::{Defaults, Method};
use softrast_raster::BackendChoice;
use softrast_runner::{Batch, Command, Progress, Run, Schedule, Settings, Task};
use softrast_softness::Family;

/// A method under test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tested {
    /// Name of the family, or `decay`.
    pub name: &'static str,
    /// Value of `--softness`.
    softness: OsString,
    decay: bool,
}

/// How much wider a decay starts than it ends, where a case names one scale only.
const DECAY: f64 = 10.0;

#[derive(Parser)]
struct Line<A: Args> {
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    args: A,
}

impl Tested {
    /// The five families with a scale that stays, and the default family with one that decays.
    ///
    /// `mlp` is a softness file to test in place of the network that has not been trained.
    pub fn all(mlp: Option<PathBuf>) -> Vec<Self> {
        let mut all: Vec<Self> = ["logistic", "gauss", "exp", "gamma", "mlp"]
            .map(|name| Self { name, softness: name.into(), decay: false })
            .into();
        if let Some(file) = mlp {
            all[4].softness = file.into();
        }
        all.push(Self { name: "decay", softness: "logistic".into(), decay: true });
        all
    }

    /// Whether the scale falls over the steps.
    pub fn decays(&self) -> bool {
        self.decay
    }

    /// The family, which for a file of any family is [`Family::Mlp`].
    pub fn family(&self) -> Family {
        self.name.parse().unwrap_or(Family::Logistic)
    }

    /// Whether the parameters come from a file, so that no case can choose their scale.
    pub fn is_file(&self) -> bool {
        self.softness.to_string_lossy().ends_with(".json")
    }

    /// The method at `scale`, in NDC; one that decays ends there, ten times as narrow as it began.
    ///
    /// # Errors
    ///
    /// If its file cannot be used.
    pub fn method_at(&self, scale: f64) -> anyhow::Result<Method> {
        let defaults = Defaults {
            task: "stability",
            schedule: Schedule::Static,
            decay: [scale; 2],
            fixed: scale,
            size: 64,
            backends: &[BackendChoice::NdArray],
        };
        let line = Line::<softrast_runner::NoArgs>::try_parse_from(self.words(&self.at(scale)))?;
        Method::new(&line.settings, &defaults)
    }

    /// Flags that set the scale.
    pub fn at(&self, scale: f64) -> String {
        match (self.is_file(), self.decay) {
            (true, _) => String::new(),
            (false, true) => format!("--scale {} --scale-end {scale}", DECAY * scale),
            (false, false) => format!("--scale {scale}"),
        }
    }

    /// Solves `runs` seeds of a task, with these flags and those of the method.
    ///
    /// # Errors
    ///
    /// Those of the task.
    pub fn solve<T: Task>(&self, flags: &str, runs: usize) -> anyhow::Result<Vec<Run>> {
        let mut line = Line::<T::Args>::try_parse_from(self.words(flags))?;
        line.settings.command = Command::Evaluate;
        let task = T::prepare(&line.settings, &line.args)?;
        let seeds: Vec<u64> = (0..runs as u64).collect();
        let mut all = Vec::with_capacity(runs);
        for seeds in seeds.chunks(task.batch_size().max(1)) {
            let batch = Batch { seeds: seeds.to_vec(), pictures: false };
            all.extend(task.run(&batch, &mut Progress::hidden())?);
        }
        Ok(all)
    }

    fn words(&self, flags: &str) -> Vec<OsString> {
        let schedule = if self.decay { "decay" } else { "static" };
        let mut words: Vec<OsString> = vec!["task".into(), "--softness".into()];
        words.extend([self.softness.clone(), "--schedule".into(), schedule.into()]);
        words.extend(flags.split_whitespace().map(OsString::from));
        words
    }
}
