use std::sync::{
    Mutex,
    atomic::{AtomicUsize, Ordering},
};

use indicatif::{ProgressBar, ProgressStyle};

use crate::{Case, Outcome, Tested};

/// Runs every case with every method on `threads` threads; outcomes in the order of cases, then
/// methods.
///
/// The threads are plain ones, outside of the pool in which images are drawn: a thread of that pool
/// that waits for an image may begin another case meanwhile, while it holds what the first needs.
pub fn run(cases: &[&Case], methods: &[Tested], threads: usize, quiet: bool) -> Vec<Outcome> {
    let cells: Vec<(&Case, &Tested)> =
        cases.iter().flat_map(|&case| methods.iter().map(move |method| (case, method))).collect();
    let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(cells.len() as u64) };
    if let Ok(style) = ProgressStyle::with_template("[{bar:32}] {pos}/{len}, {msg}, {eta} left") {
        bar.set_style(style.progress_chars("=> "));
    }
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::with_capacity(cells.len())));
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some((case, method)) = cells.get(k) else { break };
                    bar.set_message(format!("{} {}: {}", case.id, case.name, method.name));
                    let outcome = Outcome::of(case, method);
                    bar.inc(1);
                    if let Ok(mut done) = done.lock() {
                        done.push((k, outcome));
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut done = done.into_inner().unwrap_or_default();
    done.sort_by_key(|&(k, _)| k);
    done.into_iter().map(|(_, outcome)| outcome).collect()
}
