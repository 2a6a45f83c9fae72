//! Durations of the tasks of each phase: they determine the time of a step on more cores.

use std::{
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

static RECORDS: AtomicBool = AtomicBool::new(false);
static TASKS: Mutex<Vec<(&'static str, Duration)>> = Mutex::new(Vec::new());

/// Runs a task of a phase, whose tasks may run in parallel. Its duration is recorded within [`recorded_tasks`].
#[doc(hidden)]
#[inline]
pub fn task<R>(phase: &'static str, work: impl FnOnce() -> R) -> R {
    if !RECORDS.load(Ordering::Relaxed) {
        return work();
    }
    let start = Instant::now();
    let done = work();
    let time = start.elapsed();
    TASKS.lock().unwrap_or_else(|held| held.into_inner()).push((phase, time));
    done
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
