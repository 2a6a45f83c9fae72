use softrast_raster::BackendChoice;
use softrast_runner::{Schedule, Settings};

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

/// Whether the flags say what a file says itself.
pub(crate) fn is_scaled(settings: &Settings) -> bool {
    settings.scale.is_some() || settings.scale_end.is_some() || settings.squared
}

/// The schedule that the flags ask for: a scale without one stays as it is.
pub(crate) fn asked_schedule(settings: &Settings) -> Option<Schedule> {
    settings.schedule.or(settings.scale.map(|_| Schedule::Static))
}

/// First and last scale.
pub(crate) fn scales(settings: &Settings, defaults: &Defaults) -> [f64; 2] {
    let unit = |scale: f64| if settings.squared { scale * scale } else { scale };
    let Settings { scale, scale_end, .. } = *settings;
    match asked_schedule(settings).unwrap_or(defaults.schedule) {
        Schedule::Static => {
            let scale = scale.unwrap_or(unit(defaults.fixed));
            [scale; 2]
        }
        Schedule::Decay => {
            let [first, last] = defaults.decay.map(unit);
            let first = scale.unwrap_or(first.max(scale_end.unwrap_or(0.0)));
            [first, scale_end.unwrap_or(last.min(first))]
        }
    }
}
