//! Evaluates all methods on all tasks and writes the tables of the paper with our figures.
//!
//! A [`Cell`] is a task in one variant solved with one method. Cells are evaluated one after the other by the code of the tasks' programs,
//! and every finished run is stored, so that the same command resumes after an interruption. All methods of a task share its seeds.

mod args;
mod cell;
mod charts;
mod crossed;
mod documents;
mod groups;
mod measured;
mod program;
mod records;
mod results;
mod tables;
mod tasks;

pub use args::{Args, NamedMethod};
pub use cell::{Cell, Role, Variation};
pub use documents::recomputed;
pub use measured::{MeanError, Measured};
pub use program::{compare, main};
pub use records::Record;
pub use tasks::{AnyTask, TASKS, task};
