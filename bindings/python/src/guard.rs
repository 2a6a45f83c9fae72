//! From Rust's errors and panics to Python's.

use std::{
    any::Any,
    fmt::Display,
    panic::{AssertUnwindSafe, catch_unwind},
};

use pyo3::{exceptions::PyValueError, prelude::*};

/// Works without the interpreter's lock; a panic becomes an error.
pub(crate) fn guarded<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let done = py.detach(|| catch_unwind(AssertUnwindSafe(work)).map_err(|panic| message(&*panic)));
    done.map_err(PyValueError::new_err)
}

/// An error of one line.
pub(crate) fn refused(what: impl Display) -> PyErr {
    PyValueError::new_err(what.to_string().lines().collect::<Vec<_>>().join(" "))
}

/// The text of a panic on one line, without the name of the macro that raised it.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
        (Some(text), _) => text,
        (_, Some(text)) => *text,
        _ => "something went wrong that has no message",
    };
    let text = text.strip_prefix("assertion `left == right` failed: ").unwrap_or(text);
    text.lines().map(str::trim).collect::<Vec<_>>().join(", ")
}
