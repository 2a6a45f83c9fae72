//! What every softrast task shares: command line, progress, results, charts and the report page.
//!
//! `evaluate` and `search` keep what they have finished, so that they can be stopped and resumed;
//! `docs/evaluating.md` says what they do and how methods are compared. `learn` drives a [`Study`].
//!
//! `choose` finds the cheapest settings that are as good as the best; [`choose()`] is the same as a call.
//!
//! A task is a library type that implements [`Task`], and a binary whose `main` is one call of
//! [`main`]. The task knows scenes, cameras and optimisers; this crate sees seeds, numbers and RGB
//! images. `examples/parabola.rs` is a whole task in one file.

mod against;
mod animation;
mod best_step;
mod chart;
mod choice;
mod choose;
mod command;
mod control;
mod convergence;
mod encoded;
mod error;
mod error_summary;
mod evaluation;
mod figure;
mod folder;
mod grid;
mod guidance;
mod heat_map;
mod interrupt;
mod job;
mod journal;
mod label;
mod ladder;
mod memory;
mod palette;
mod picture;
mod plan;
mod prepared;
mod program;
mod progress;
mod quantity;
mod report;
mod resolution;
mod returned;
mod search;
mod search_summary;
mod settings;
mod space;
mod statistics;
mod stored;
mod study;
mod summary;
mod table;
mod task;
mod ticks;
mod trial;

/// Images come and go by the thousand, each too large for the system's allocator to keep: it maps
/// their pages anew every time, which costs a seventh of a step.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

pub use best_step::best_step;
pub use choice::{Choice, Reason, Stage};
pub use choose::choose;
pub use error::{Error, Failure};
pub use grid::{Grid, OwnAxis};
pub use memory::peak_rss_mib;
pub use palette::method_colour;
pub use picture::{contact_sheet, difference, rgb_from_gray, rgb_from_planes};
pub use plan::{Input, Judged, Order, Plan, Referee};
pub use program::{execute, main};
pub use progress::Progress;
pub use report::{escape, page};
pub use resolution::Resolution;
pub use settings::{Command, Init, Schedule, Settings, SoftnessChoice, Variant, usual_tolerance};
pub use statistics::{bootstrap_mean_interval, mean, median, quantile, wilson_interval};
pub use study::{Curve, Figure, Learned, OuterStep, Study};
pub use task::{
    Batch, Description, Detail, ErrorGroup, ExtraError, Measure, NoArgs, Pictures, Point, Run,
    Score, Task,
};
pub use ticks::{MarkedAxis, Ticks};
