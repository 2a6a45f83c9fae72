use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Shows on stderr how far the work is.
///
/// On a terminal it is a bar with step, loss and time left; elsewhere a line every ten seconds.
pub struct Progress {
    bar: ProgressBar,
    lines: bool,
    last_line: Instant,
    before: u64,
    prefix: String,
}

/// Time between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Progress {
    /// Progress that nobody sees, for a task that is run as a library.
    pub fn hidden() -> Self {
        Self::new(0, ProgressDrawTarget::hidden(), false)
    }

    /// Progress of `steps` steps over all batches.
    pub(crate) fn visible(steps: usize) -> Self {
        if std::io::stderr().is_terminal() {
            Self::new(steps, ProgressDrawTarget::stderr(), false)
        } else {
            Self::new(steps, ProgressDrawTarget::hidden(), true)
        }
    }

    fn new(steps: usize, target: ProgressDrawTarget, lines: bool) -> Self {
        let bar = ProgressBar::with_draw_target(Some(steps as u64), target);
        let template = "{prefix} [{bar:32}] step {pos}/{len}, {msg}, {eta} left";
        let style = ProgressStyle::with_template(template).expect("the template is valid");
        bar.set_style(style.progress_chars("=> "));
        Self { bar, lines, last_line: Instant::now(), before: 0, prefix: String::new() }
    }

    /// Starts a batch; `prefix` says which, and `before` counts the steps of those before it.
    pub(crate) fn start(&mut self, prefix: String, before: usize) {
        self.before = before as u64;
        self.bar.set_prefix(prefix.clone());
        self.prefix = prefix;
    }

    /// Tells that `step` steps of this batch are done, and the loss they led to.
    ///
    /// # Errors
    ///
    /// Fails when the work should stop here; the task passes that on.
    pub fn step(&mut self, step: usize, loss: f64) -> anyhow::Result<()> {
        let done = self.before + step as u64;
        self.bar.set_message(format!("loss {loss:.4e}"));
        self.bar.set_position(done);
        if self.lines && self.last_line.elapsed() >= LINE_EVERY {
            self.last_line = Instant::now();
            let steps = self.bar.length().unwrap_or(done);
            let left = indicatif::HumanDuration(self.bar.eta());
            eprintln!("{}: step {done}/{steps}, loss {loss:.4e}, {left} left", self.prefix);
        }
        Ok(())
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
