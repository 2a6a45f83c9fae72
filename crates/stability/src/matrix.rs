use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;
use serde::{Deserialize, Serialize};
use serde_json::json;
use softrast_lab::{Store, key, median, wilson_interval};

use crate::{Case, Level, Tested, drawing::largest};

/// All outcomes: one row per case, one column per method.
#[derive(Serialize)]
pub struct Matrix {
    /// Names of the methods.
    pub methods: Vec<String>,
    /// Cases with their outcomes, in the order of the methods.
    pub rows: Vec<Row>,
    /// Number of trials.
    pub trials: usize,
    /// Trials with a number that is not finite.
    pub non_finite: usize,
    /// Sum of the wall times of all outcomes, in seconds.
    pub seconds: f64,
}

/// One case and its outcomes.
#[derive(Serialize)]
pub struct Row {
    /// The case.
    #[serde(flatten)]
    pub case: &'static Case,
    /// Outcomes in the order of the methods.
    pub outcomes: Vec<Outcome>,
}

/// Outcome of one case with one method.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outcome {
    /// The method.
    pub method: String,
    /// Number of trials of all levels.
    pub trials: usize,
    /// Number of trials that reached the target.
    pub reached: usize,
    /// Wilson 95 % interval of the share that reaches it.
    pub ci95: [f64; 2],
    /// Trials with a number that is not finite; 0 unless something is broken.
    pub non_finite: usize,
    /// Outcomes from the first to the last level.
    pub levels: Vec<LevelOutcome>,
    /// Panic or error that ended the case, if any.
    pub failed: Option<String>,
    /// Wall time, in seconds.
    pub seconds: f64,
}

/// Outcome of one level with one method.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LevelOutcome {
    /// The strength of the perturbation as a word.
    pub label: String,
    /// The strength as a number, if it is one.
    pub at: Option<f64>,
    /// Number of trials.
    pub trials: usize,
    /// Number of trials that reached the target.
    pub reached: usize,
    /// Wilson 95 % interval of the share that reaches it.
    pub ci95: [f64; 2],
    /// Trials with a number that is not finite.
    pub non_finite: usize,
    /// Median measured number; none if it is not finite.
    pub median: Option<f64>,
    /// Largest measured number; none if it is not finite.
    pub worst: Option<f64>,
}

/// Runs every case with every method on `threads` threads, except those in the store; a shard runs only its own.
///
/// Each thread draws in a separate pool with its share of the cores. The threads of one pool cannot run cases: a thread that waits for an
/// image may begin another case while it holds what the first needs. A caller that is a thread of the common pool waits here without
/// working for it, so that no case may need that pool, which may have no other thread.
///
/// # Errors
///
/// If the store cannot be written, or a thread cannot be started.
pub fn run(
    cases: &[&'static Case],
    methods: &[Tested],
    store: Store<Outcome>,
    threads: usize,
    quiet: bool,
) -> anyhow::Result<Matrix> {
    let all = cases.iter().flat_map(|&case| methods.iter().map(move |method| (case, method)));
    let is_mine = |(k, _): &(usize, _)| store.shard().is_none_or(|shard| shard.takes(*k));
    let cells = all.enumerate().filter(is_mine).map(|(_, cell)| cell);
    let cells: Vec<(&'static Case, &Tested)> = cells.collect();
    let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(cells.len() as u64) };
    if let Ok(style) = ProgressStyle::with_template("[{bar:32}] {pos}/{len}, {msg}, {eta} left") {
        bar.set_style(style.progress_chars("=> "));
    }
    let (next, done) = (AtomicUsize::new(0), Mutex::new((store, Vec::with_capacity(cells.len()))));
    let failed = Mutex::new(None);
    let threads = threads.max(1);
    let share = (rayon::current_num_threads() / threads).max(1);
    let work = || {
        while let Some((case, method)) = cells.get(next.fetch_add(1, Ordering::Relaxed)) {
            bar.set_message(format!("{} {}: {}", case.id, case.name, method.name));
            let (key, name) = (key_of(case, method), format!("{} {}", case.id, method.name));
            let lock = || done.lock().unwrap_or_else(PoisonError::into_inner);
            let kept = lock().0.get(&key).cloned();
            let outcome = kept.unwrap_or_else(|| {
                let outcome = Outcome::of(case, method);
                if let Err(error) = lock().0.put(&key, &name, &outcome) {
                    failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                }
                outcome
            });
            bar.inc(1);
            lock().1.push((case.id, outcome));
        }
    };
    let in_own_pool = || match ThreadPoolBuilder::new().num_threads(share).build() {
        Ok(pool) => pool.install(work),
        Err(error) => {
            failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.into());
        }
    };
    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(in_own_pool))));
    bar.finish_and_clear();
    if let Some(failed) = failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(failed);
    }
    let (_, done) = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    let row = |&case: &&'static Case| {
        let of_method = |method: &Tested| {
            let found = |(id, o): &&(&str, Outcome)| *id == case.id && o.method == method.name;
            done.iter().find(found).map(|(_, outcome)| outcome.clone())
        };
        Row { case, outcomes: methods.iter().filter_map(of_method).collect() }
    };
    let sum = |of: fn(&Outcome) -> usize| done.iter().map(|(_, outcome)| of(outcome)).sum();
    Ok(Matrix {
        methods: methods.iter().map(|method| method.name.clone()).collect(),
        rows: cases.iter().map(row).collect(),
        trials: sum(|outcome| outcome.trials),
        non_finite: sum(|outcome| outcome.non_finite),
        seconds: done.iter().map(|(_, outcome)| outcome.seconds).sum(),
    })
}

/// Key of an outcome in the store.
fn key_of(case: &Case, method: &Tested) -> String {
    key(&json!({ "case": case.id, "method": method.identity() }))
}

impl Matrix {
    /// One line for each fault of the program: a panic, an error, numbers that are not finite.
    pub fn faults(&self) -> Vec<String> {
        let faults = self.rows.iter().flat_map(|row| {
            row.outcomes.iter().filter_map(|outcome| {
                let head = format!("broken: {} {}, {}", row.case.id, row.case.name, outcome.method);
                match (&outcome.failed, outcome.non_finite) {
                    (Some(failed), _) => Some(format!("{head}: {failed}")),
                    (None, 0) => None,
                    (None, count) => Some(format!("{head}: {count} trials are not finite")),
                }
            })
        });
        faults.collect()
    }
}

impl Outcome {
    /// Runs a case with a method; a panic becomes part of the outcome.
    fn of(case: &Case, tested: &Tested) -> Self {
        let clock = Instant::now();
        let (levels, failed) = match catch_unwind(AssertUnwindSafe(|| (case.run)(tested))) {
            Ok(Ok(levels)) => (levels, None),
            Ok(Err(error)) => (Vec::new(), Some(format!("{error:#}"))),
            Err(panic) => (Vec::new(), Some(format!("panic: {}", words(panic.as_ref())))),
        };
        let levels: Vec<LevelOutcome> = levels.iter().map(LevelOutcome::of).collect();
        let sum = |of: fn(&LevelOutcome) -> usize| levels.iter().map(of).sum();
        let (trials, reached) = (sum(|l| l.trials), sum(|l| l.reached));
        Self {
            method: tested.name.clone(),
            trials,
            reached,
            ci95: wilson_interval(reached, trials),
            non_finite: sum(|l| l.non_finite),
            levels,
            failed,
            seconds: clock.elapsed().as_secs_f64(),
        }
    }

    /// The first level at which fewer than half of the trials reach the target, if there is one.
    pub fn fails_at(&self) -> Option<&LevelOutcome> {
        self.levels.iter().find(|level| 2 * level.reached < level.trials)
    }

    /// The share that reached the target, as a short text.
    pub fn share(&self) -> String {
        match (&self.failed, self.non_finite) {
            (Some(_), _) => "FAILED".into(),
            (None, 0) => format!("{}/{}", self.reached, self.trials),
            (None, count) => format!("{count} NaN"),
        }
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
            worst: finite(largest(values)),
        }
    }
}

fn words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
