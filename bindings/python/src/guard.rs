//! From Rust's errors and panics to Python's.

use std::{
    any::Any,
    fmt::Display,
    panic::{AssertUnwindSafe, catch_unwind},
    process,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use pyo3::{exceptions::PyValueError, prelude::*};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The process that loaded this library.
static LOADED_BY: OnceLock<u32> = OnceLock::new();
/// Threads of a process that was forked from it, and which one.
static FORKED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Works without the interpreter's lock; a panic becomes an error.
pub(crate) fn guarded<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| caught(work)).map_err(PyValueError::new_err)
}

/// Works on threads that this process has; a panic becomes its message.
pub(crate) fn caught<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, String> {
    match own_threads()? {
        None => unwound(work),
        Some(threads) => threads.install(|| unwound(work)),
    }
}

/// Works on this thread; a panic becomes its message.
pub(crate) fn unwound<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| message(&*panic))
}

/// To be called as the library is loaded.
pub(crate) fn remember_process() {
    LOADED_BY.get_or_init(process::id);
}

/// How many threads draw in this process.
#[pyfunction]
pub(crate) fn threads(py: Python<'_>) -> PyResult<usize> {
    guarded(py, rayon::current_num_threads)
}

/// Threads for a process that was forked: it has none of those that the other one started, and would wait for them for ever.
fn own_threads() -> Result<Option<Arc<ThreadPool>>, String> {
    let id = process::id();
    if LOADED_BY.get() == Some(&id) {
        return Ok(None);
    }
    let mut forked = FORKED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, threads)) = forked.as_ref().filter(|(of, _)| *of == id) {
        return Ok(Some(threads.clone()));
    }
    let threads = ThreadPoolBuilder::new().build().map_err(|error| error.to_string())?;
    let threads = Arc::new(threads);
    // Threads of the process before a fork are leaked: to end them would wait for them.
    std::mem::forget(forked.replace((id, threads.clone())));
    Ok(Some(threads))
}

/// An error of one line.
pub(crate) fn refused(what: impl Display) -> PyErr {
    PyValueError::new_err(what.to_string().lines().collect::<Vec<_>>().join(" "))
}

/// The text of a panic on one line, without the name of the macro that raised it.
pub(crate) fn message(panic: &(dyn Any + Send)) -> String {
    let text = match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
        (Some(text), _) => text,
        (_, Some(text)) => *text,
        _ => "something went wrong that has no message",
    };
    let text = text.strip_prefix("assertion `left == right` failed: ").unwrap_or(text);
    text.lines().map(str::trim).collect::<Vec<_>>().join(", ")
}
