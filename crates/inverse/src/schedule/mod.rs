//! A softness over a run: the schedule of its scale, by time or by the error, and its other settings.

mod adaptive;
mod file;
mod own_file;
mod scale_schedule;
mod scheduled;

pub use adaptive::{AdaptiveSchedule, AdaptiveStep, Controller};
pub use scale_schedule::ScaleSchedule;
pub use scheduled::{ScheduledSoftness, Surrogate};
