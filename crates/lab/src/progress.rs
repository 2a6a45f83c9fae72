use std::{
    io::IsTerminal,
    process,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::{Error, error::INTERRUPTED, printable};

/// Shows the progress of the work on stderr, and stops it on request of the user.
///
/// On a terminal it is a bar with steps, loss and remaining time; elsewhere a line every ten seconds. Each step counts
/// once for every run that makes it, so that batches of any size share one bar.
pub struct Progress {
    bar: ProgressBar,
    lines: bool,
    last_line: Instant,
    stop: &'static AtomicBool,
    /// Steps of all runs of earlier batches.
    before: u64,
    /// Steps made by an earlier call of the program.
    skipped: u64,
    /// Runs and steps of this batch.
    runs: usize,
    steps: usize,
    prefix: String,
}

/// Time between two lines without a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// For work that cannot be stopped.
static NEVER: AtomicBool = AtomicBool::new(false);
/// Whether the user has requested a stop.
static STOP: AtomicBool = AtomicBool::new(false);

/// Makes Ctrl-C stop the work after the current step; a second one ends the program at once.
pub fn stop_on_ctrl_c() {
    // Without a handler Ctrl-C ends the program at once, which loses no finished run either.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            process::exit(INTERRUPTED.into());
        }
        eprintln!("\nstopping after this step; Ctrl-C once more ends at once");
    });
}

impl Progress {
    /// Progress that is neither shown nor stopped, for library use.
    pub fn hidden() -> Self {
        Self::new(ProgressDrawTarget::hidden(), false, &NEVER)
    }

    /// Progress of a program, which ends on Ctrl-C; shown unless `quiet`.
    pub fn of_program(quiet: bool) -> Self {
        let on_terminal = std::io::stderr().is_terminal();
        match (quiet, on_terminal) {
            (false, true) => Self::new(ProgressDrawTarget::stderr(), false, &STOP),
            (quiet, _) => Self::new(ProgressDrawTarget::hidden(), !quiet, &STOP),
        }
    }

    fn new(target: ProgressDrawTarget, lines: bool, stop: &'static AtomicBool) -> Self {
        let bar = ProgressBar::with_draw_target(Some(0), target);
        let template = "{prefix} [{bar:32}] step {pos}/{len}{msg}";
        let style = ProgressStyle::with_template(template).expect("the template is valid");
        bar.set_style(style.progress_chars("=> "));
        let last_line = Instant::now();
        Self {
            bar,
            lines,
            last_line,
            stop,
            before: 0,
            skipped: 0,
            runs: 1,
            steps: 0,
            prefix: String::new(),
        }
    }

    /// Sets the total number of steps of all runs of all batches.
    pub fn expect(&self, steps: usize) {
        self.bar.set_length(steps as u64);
    }

    /// Starts a batch of `runs` of `steps` steps each; `prefix` is its label.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`] if the user has requested a stop.
    pub fn begin(&mut self, prefix: String, runs: usize, steps: usize) -> Result<(), Error> {
        if self.stop.load(Ordering::SeqCst) {
            return Err(Error::Interrupted);
        }
        (self.runs, self.steps) = (runs, steps);
        let prefix = printable(&prefix).into_owned();
        self.bar.set_prefix(prefix.clone());
        self.prefix = prefix;
        Ok(())
    }

    /// Reports that `step` steps of this batch are done, and their last loss.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`] if the work should stop here; pass it on.
    pub fn step(&mut self, step: usize, loss: f64) -> anyhow::Result<()> {
        let done = self.before + (step * self.runs) as u64;
        self.bar.set_position(done);
        let left = self.left(done);
        self.bar.set_message(format!(", loss {loss:.4e}{left}"));
        if self.lines && self.last_line.elapsed() >= LINE_EVERY {
            self.last_line = Instant::now();
            let steps = self.bar.length().unwrap_or(done);
            eprintln!("{}: step {done}/{steps}, loss {loss:.4e}{left}", self.prefix);
        }
        // After the last step the batch is nearly finished, and would be lost.
        if step < self.steps && self.stop.load(Ordering::SeqCst) {
            return Err(Error::Interrupted.into());
        }
        Ok(())
    }

    /// The remaining time, once a tenth of the steps is done: the first steps of a program are not representative.
    fn left(&self, done: u64) -> String {
        let steps = self.bar.length().unwrap_or(done) - self.skipped;
        if 10 * (done - self.skipped) < steps {
            return String::new();
        }
        format!(", {} left", indicatif::HumanDuration(self.bar.eta()))
    }

    /// Ends the batch that began last.
    pub fn end(&mut self) {
        self.before += (self.runs * self.steps) as u64;
        self.bar.set_position(self.before);
    }

    /// Skips steps that an earlier call of the program has made.
    pub fn skip(&mut self, runs: usize, steps: usize) {
        self.before += (runs * steps) as u64;
        self.skipped += (runs * steps) as u64;
        self.bar.set_position(self.before);
        // They took no time in this call, and must not affect the estimate.
        self.bar.reset_eta();
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_shown_from_a_tenth_of_the_steps_on() {
        let mut progress = Progress::hidden();
        progress.expect(300);
        progress.begin("run".into(), 2, 150).unwrap();
        progress.skip(1, 100);
        assert_eq!(progress.left(119), "");
        assert!(progress.left(120).ends_with(" left"));
    }

    #[test]
    fn a_stopped_batch_ends_after_its_step_unless_that_was_its_last() {
        let stop: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
        let mut progress = Progress::new(ProgressDrawTarget::hidden(), false, stop);
        progress.begin("run".into(), 1, 3).unwrap();
        progress.step(1, 0.5).unwrap();
        stop.store(true, Ordering::SeqCst);
        let stopped = progress.step(2, 0.5).unwrap_err();
        assert!(matches!(stopped.downcast_ref(), Some(Error::Interrupted)));
        progress.step(3, 0.5).unwrap();
        progress.end();
        assert!(matches!(progress.begin("run".into(), 1, 3), Err(Error::Interrupted)));
    }

    #[test]
    fn batches_of_any_size_share_one_bar() {
        let mut progress = Progress::hidden();
        progress.expect(100);
        progress.skip(2, 10);
        progress.begin("runs".into(), 4, 10).unwrap();
        progress.step(5, 0.5).unwrap();
        assert_eq!(progress.bar.position(), 40);
        progress.end();
        assert_eq!((progress.bar.position(), progress.bar.length()), (60, Some(100)));
    }
}
