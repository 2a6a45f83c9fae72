//! Long work on a thread of its own, with progress for Python and an end by Ctrl-C.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError, Sender},
    },
    thread,
    time::Duration,
};

use anyhow::ensure;
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*};

use crate::guard::{caught, refused};

/// Time after which Ctrl-C is seen.
const BETWEEN_SIGNALS: Duration = Duration::from_millis(50);

/// Tells what watches the work of its steps.
pub(crate) struct Watch {
    shown: Sender<(usize, usize, f64)>,
    ended: Arc<AtomicBool>,
}

impl Watch {
    /// Whether the work is to end.
    pub(crate) fn is_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// Shows the number of a step, the largest that it may have, and the loss there.
    ///
    /// # Errors
    ///
    /// If the work is to end.
    pub(crate) fn step(&self, step: usize, steps: usize, loss: f64) -> anyhow::Result<()> {
        ensure!(!self.is_ended(), "the work was ended");
        Ok(self.shown.send((step, steps, loss))?)
    }
}

/// The result of `work`, and whether Ctrl-C ended it early. `visit` receives each step; a KeyboardInterrupt that it raises counts as Ctrl-C. Where it `waits`, the step at
/// which the work ends then is awaited; else the KeyboardInterrupt is returned.
///
/// # Errors
///
/// Errors of `visit` and of the work, and KeyboardInterrupt before the first step whose result could be returned.
pub(crate) fn watched<T: Send + 'static>(
    py: Python<'_>,
    visit: Option<Py<PyAny>>,
    waits: bool,
    work: impl FnOnce(Watch) -> anyhow::Result<T> + Send + 'static,
) -> PyResult<(T, bool)> {
    let (shown, mut seen) = mpsc::channel();
    let ended = Arc::new(AtomicBool::new(false));
    let watch = Watch { shown, ended: ended.clone() };
    // It ends at its next step: what comes before the first one takes seconds for a large mesh.
    let working = thread::spawn(move || caught(|| work(watch).map_err(|why| format!("{why:#}"))));
    let (mut begun, mut interrupted) = (false, false);
    loop {
        let (step, again) = py.detach(move || (seen.recv_timeout(BETWEEN_SIGNALS), seen));
        seen = again;
        begun |= step.is_ok();
        let visited = py.check_signals().and_then(|()| match (&visit, step) {
            (Some(visit), Ok(step)) if !interrupted => visit.call1(py, step).map(drop),
            _ => Ok(()),
        });
        if let Err(error) = visited {
            ended.store(true, Ordering::Relaxed);
            // Ctrl-C for the second time does not wait.
            if interrupted || !begun || !waits || !error.is_instance_of::<PyKeyboardInterrupt>(py) {
                return Err(error);
            }
            interrupted = true;
        }
        if step == Err(RecvTimeoutError::Disconnected) {
            break;
        }
    }
    let done = py.detach(|| working.join()).map_err(|_| refused("the work has no result"))?;
    Ok((done.and_then(|done| done).map_err(refused)?, interrupted))
}
