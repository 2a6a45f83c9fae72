//! Durations of the tasks of each phase: they determine the time of a step on more cores.

use std::{
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use rayon::prelude::*;

static RECORDS: AtomicBool = AtomicBool::new(false);
static TASKS: Mutex<Vec<(&'static str, Duration)>> = Mutex::new(Vec::new());

/// Numbers that [`filled`] writes per task.
const AT_ONCE: usize = 1 << 16;

/// A task from its creation to its drop.
struct Running {
    phase: &'static str,
    /// Absent unless tasks are recorded.
    start: Option<Instant>,
}

impl Running {
    #[inline]
    fn new(phase: &'static str) -> Self {
        Self { phase, start: RECORDS.load(Ordering::Relaxed).then(Instant::now) }
    }
}

impl Drop for Running {
    #[inline]
    fn drop(&mut self) {
        if let Some(start) = self.start {
            let time = start.elapsed();
            TASKS.lock().unwrap_or_else(|held| held.into_inner()).push((self.phase, time));
        }
    }
}

/// Runs a task of a phase, whose tasks may run in parallel. Its duration is recorded within [`recorded_tasks`].
#[doc(hidden)]
#[inline]
pub fn task<R>(phase: &'static str, work: impl FnOnce() -> R) -> R {
    let _running = Running::new(phase);
    work()
}

/// A vector of one value. Long ones are written in parallel, since the first access to new memory is slow.
#[doc(hidden)]
pub fn filled<T: Copy + Send + Sync>(value: T, length: usize) -> Vec<T> {
    if length <= AT_ONCE {
        return vec![value; length];
    }
    let parts = (0..length).into_par_iter().with_min_len(AT_ONCE / 2).with_max_len(AT_ONCE);
    parts.map_init(|| Running::new("memory"), |_, _| value).collect()
}

/// Runs some work, and lists the tasks of the whole process meanwhile, in the order of their ends, each with its phase.
#[doc(hidden)]
pub fn recorded_tasks<R>(work: impl FnOnce() -> R) -> (R, Vec<(&'static str, Duration)>) {
    let tasks = || std::mem::take(&mut *TASKS.lock().unwrap_or_else(|held| held.into_inner()));
    tasks();
    RECORDS.store(true, Ordering::Relaxed);
    let done = work();
    RECORDS.store(false, Ordering::Relaxed);
    (done, tasks())
}
