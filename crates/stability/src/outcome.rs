use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::Instant,
};

use serde::Serialize;
use softrast_runner::{median, wilson_interval};

use crate::{Case, Level, Promise, Tested};

/// What one case made of one method.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// The case.
    pub case: &'static str,
    /// The method.
    pub method: &'static str,
    /// Trials of all levels.
    pub trials: usize,
    /// How many reached the target.
    pub reached: usize,
    /// 95 % interval of the share that does, after Wilson.
    pub ci95: [f64; 2],
    /// Trials with a number that is not finite; 0 unless something is broken.
    pub non_finite: usize,
    /// The worst measured number; none where it is not finite.
    pub worst: Option<f64>,
    /// From the first to the last level.
    pub levels: Vec<LevelOutcome>,
    /// How the case ended where it could not be finished: a panic or an error.
    pub failed: Option<String>,
    /// Wall time.
    pub seconds: f64,
}

/// What one level made of one method.
#[derive(Clone, Debug, Serialize)]
pub struct LevelOutcome {
    /// The strength of the perturbation as a word.
    pub label: String,
    /// The strength as a number, if it is one.
    pub at: Option<f64>,
    /// Trials.
    pub trials: usize,
    /// How many reached the target.
    pub reached: usize,
    /// 95 % interval of the share that does, after Wilson.
    pub ci95: [f64; 2],
    /// Trials with a number that is not finite.
    pub non_finite: usize,
    /// Middle measured number; none where it is not finite.
    pub median: Option<f64>,
    /// Largest measured number; none where it is not finite.
    pub worst: Option<f64>,
}

impl Outcome {
    /// Runs a case with a method; a panic becomes part of the outcome.
    pub fn of(case: &Case, tested: &Tested) -> Self {
        let clock = Instant::now();
        let (levels, failed) = match catch_unwind(AssertUnwindSafe(|| (case.run)(tested))) {
            Ok(Ok(levels)) => (levels, None),
            Ok(Err(error)) => (Vec::new(), Some(format!("{error:#}"))),
            Err(panic) => (Vec::new(), Some(format!("panic: {}", words(panic.as_ref())))),
        };
        let levels: Vec<LevelOutcome> = levels.iter().map(LevelOutcome::of).collect();
        let sum = |of: fn(&LevelOutcome) -> usize| levels.iter().map(of).sum();
        let (trials, reached) = (sum(|l| l.trials), sum(|l| l.reached));
        let worst = levels.iter().map(|level| level.worst).collect::<Option<Vec<f64>>>();
        Self {
            case: case.id,
            method: tested.name,
            trials,
            reached,
            ci95: wilson_interval(reached, trials),
            non_finite: sum(|l| l.non_finite),
            worst: worst.and_then(|all| all.into_iter().reduce(f64::max)),
            levels,
            failed,
            seconds: clock.elapsed().as_secs_f64(),
        }
    }

    /// Whether this is a fault of the program and no property of the method.
    pub fn is_broken(&self, promise: Promise) -> bool {
        let missed = promise == Promise::Guaranteed && self.reached < self.trials;
        self.failed.is_some() || self.non_finite > 0 || missed
    }

    /// The first level from which on fewer than half of the trials reach the target, if there is one.
    pub fn fails_at(&self) -> Option<&LevelOutcome> {
        self.levels.iter().find(|level| 2 * level.reached < level.trials)
    }
}

impl LevelOutcome {
    fn of(level: &Level) -> Self {
        let Level { label, at, trials } = level;
        let reached = trials.iter().filter(|trial| trial.reached).count();
        let values: Vec<f64> = trials.iter().map(|trial| trial.value).collect();
        let finite = |x: f64| Some(x).filter(|x| x.is_finite());
        Self {
            label: label.clone(),
            at: *at,
            trials: trials.len(),
            reached,
            ci95: wilson_interval(reached, trials.len()),
            non_finite: trials.iter().filter(|trial| !trial.finite).count(),
            median: finite(median(&values)),
            worst: finite(crate::drawn::largest(values)),
        }
    }
}

fn words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
