use std::{
    cell::Cell,
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::Epoch;

/// Time between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(20);

/// Shows on stderr how a training goes: a bar on a terminal, else a line every now and then, and in any
/// case a line after every epoch.
pub(crate) struct Bar {
    bar: ProgressBar,
    visible: bool,
    lines: bool,
    last_line: Cell<Instant>,
}

impl Bar {
    /// For so many steps; silent unless `visible`.
    pub(crate) fn new(visible: bool, steps: u64) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let target = match visible && terminal {
            true => ProgressDrawTarget::stderr(),
            false => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(steps), target);
        let template = "[{bar:32}] step {pos}/{len}, {msg}, {eta} left";
        let style = ProgressStyle::with_template(template).expect("the template is valid");
        bar.set_style(style.progress_chars("=> "));
        Self { bar, visible, lines: visible && !terminal, last_line: Cell::new(Instant::now()) }
    }

    /// Passes over steps that were made before.
    pub(crate) fn skip(&self, steps: u64) {
        self.bar.set_position(steps);
        self.bar.reset_eta();
    }

    /// Counts a step.
    pub(crate) fn step(&self, loss: f64, silhouette_iou: f64) {
        let message = format!("loss {loss:.4}, silhouette IoU {silhouette_iou:.3}");
        self.bar.inc(1);
        if self.lines && self.last_line.get().elapsed() >= LINE_EVERY {
            self.last_line.set(Instant::now());
            let (step, steps) = (self.bar.position(), self.bar.length().unwrap_or(0));
            eprintln!("step {step}/{steps}, {message}, {} left", HumanDuration(self.bar.eta()));
        }
        self.bar.set_message(message);
    }

    /// Says what an epoch brought.
    pub(crate) fn epoch(&self, epoch: &Epoch, epochs: usize) {
        if !self.visible {
            return;
        }
        let loss = epoch.loss.map_or_else(String::new, |loss| format!("loss {loss:.4}, "));
        let rate = epoch.time.rate();
        let rate = if rate > 0.0 {
            let share = 100.0 * epoch.time.rasterizer_share();
            format!(", {rate:.1} pictures/s, rasterizer {share:.0} %")
        } else {
            String::new()
        };
        let line = format!(
            "epoch {}/{epochs}: {loss}voxel IoU {:.3}{rate}",
            epoch.number,
            epoch.mean_iou()
        );
        self.bar.suspend(|| eprintln!("{line}"));
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
