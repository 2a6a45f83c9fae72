//! The command line of a task: `solve`, `evaluate`, `search`, `choose` and `learn`.
//!
//! A program is a type that implements [`Task`] and a `main` of one call of [`main()`], or of [`main_of_two`]. [`MethodArgs`] are the flags
//! of a method; together with a task they make a [`TaskExperiment`], which `softrast-lab` runs, stores and compares.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu", feature = "cuda")))]
compile_error!(
    "a program needs a backend: turn on one of the features ndarray, flex, wgpu and cuda"
);

mod backend;
mod command_line;
mod commands;
mod diagnostics;
mod entry;
mod experiment;
mod flags;
mod given;
mod learn_args;
mod learned_charts;
mod method;
mod paper;
mod program;
mod searched;
mod session;
mod task;

/// Images are allocated by the thousand, each too large for the system's allocator to reuse: it would map their pages
/// anew every time, which costs a seventh of a step. Every program of a task links this crate, and no library does.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

pub use backend::backend;
pub use entry::Entry;
pub use experiment::{Purpose, TaskExperiment};
pub use flags::{
    Common, EXPERIMENTS, Init, MethodArgs, PRESET, Schedule, SoftnessChoice, Variant, usual_args,
};
pub use given::{Answer, Given, MaskFlags, beside, viewer};
pub use method::{Scales, is_preset, is_preset_learned, learned_kind, method_colour};
pub use paper::{InOurUnits, Paper};
pub use program::{execute, main, main_of_two};
pub use searched::Searched;
pub use task::{Description, Detail, EdgeChoice, Ended, Measures, NoArgs, OwnAxis, Task, theta_of};
