//! What every softrast task shares: command line, progress, results, charts and the report page.
//!
//! A task is a library type that implements [`Task`], and a binary whose `main` is one call of
//! [`main`]. The task knows scenes, cameras and optimisers; this crate sees seeds, numbers and RGB
//! images. `examples/parabola.rs` is a whole task in one file.

mod animation;
mod chart;
mod error;
mod folder;
mod job;
mod label;
mod memory;
mod picture;
mod program;
mod progress;
mod report;
mod settings;
mod statistics;
mod summary;
mod table;
mod task;

pub use error::{Error, Failure};
pub use memory::peak_rss_mib;
pub use picture::{contact_sheet, difference, rgb_from_gray, rgb_from_planes};
pub use program::{execute, main};
pub use progress::Progress;
pub use settings::{Command, Schedule, Settings, SoftnessChoice, Variant};
pub use statistics::{bootstrap_mean_interval, mean, median, quantile, wilson_interval};
pub use task::{
    Batch, Description, ErrorGroup, ExtraError, Measure, NoArgs, Pictures, Point, Run, Task,
};
