//! A softness over a run: the schedule of its scale, by time or by the error, and its other settings.

mod feedback;
mod file;
mod own_file;
mod scale_schedule;
mod scheduled;

pub use feedback::{Feedback, Follower, Place};
pub use scale_schedule::ScaleSchedule;
pub use scheduled::{ScheduledSoftness, Surrogate};
