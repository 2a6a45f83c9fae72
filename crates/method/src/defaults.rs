use softrast_raster::BackendChoice;
use softrast_runner::Schedule;

use crate::Searched;

/// Scales of a task that the command line does not name, as widths in NDC. A family that
/// [`Searched`] knows has its own instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Defaults {
    /// Name of the task.
    pub task: &'static str,
    /// How the scale moves if neither a schedule nor a scale is given.
    pub schedule: Schedule,
    /// First and last scale of a decay.
    pub decay: [f64; 2],
    /// Scale of a static softness.
    pub fixed: f64,
    /// Width and height of the image where the command line does not say, in pixels.
    pub size: usize,
    /// What the task was compiled for: `softrast_raster::compiled_backends!()` there.
    pub backends: &'static [BackendChoice],
}

impl Defaults {
    /// With the schedule and the scale that were searched for.
    pub(crate) fn with(self, found: &Searched) -> Self {
        match *found {
            Searched { scale, scale_end: None, .. } => {
                Self { schedule: Schedule::Static, fixed: scale, ..self }
            }
            Searched { scale, scale_end: Some(end), .. } => {
                Self { schedule: Schedule::Decay, decay: [scale, end], ..self }
            }
        }
    }
}
