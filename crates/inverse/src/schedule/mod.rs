//! A softness over a run: how its scale moves, by time or by what the run sees, and what it comes with.

mod feedback;
mod own_file;
mod scale_schedule;
mod scheduled;

pub use feedback::{Feedback, Follower, Place};
pub use scale_schedule::ScaleSchedule;
pub use scheduled::{ScheduledSoftness, Surrogate};
