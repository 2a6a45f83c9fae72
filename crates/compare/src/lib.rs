//! Evaluates all methods on all tasks and writes the tables of the paper with our figures.
//!
//! A [`Cell`] is a task in one variant solved with one method. Cells are evaluated one after the
//! other by the same programs that a user runs by hand, each in a folder of its own with a journal, so
//! the same command goes on after a kill. All methods of a task share its seeds.

mod args;
mod cell;
mod charts;
mod crossed;
mod functions;
mod machine;
mod measured;
mod paper;
mod plot;
mod program;
mod records;
mod results;
mod table;
mod task;
mod trace;

pub use args::Args;
pub use cell::{Cell, Purpose};
pub use measured::{Error, Measured};
pub use paper::Printed;
pub use program::{compare, main};
pub use results::markdown;
pub use task::TaskName;
pub use trace::Trace;
