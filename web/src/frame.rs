use std::pin::Pin;

use serde::Serialize;
use softrast_inverse::Iterate;
use softrast_tensor::read_sync;

use crate::CameraView;

/// A pending frame; on the CPU it is ready at once.
pub type Coming<'a> = Pin<Box<dyn Future<Output = anyhow::Result<Option<Frame>>> + 'a>>;

/// A run that advances one step per call.
pub trait Run {
    /// Pixels a side of its images.
    fn size(&self) -> usize;

    /// Steps of the whole run.
    fn steps(&self) -> usize;

    /// The target image, `[size * size]`, top row first, in [0, 1].
    fn target(&self) -> Vec<f64>;

    /// The camera of the target, if it is known.
    fn truth(&self) -> Option<CameraView> {
        None
    }

    /// Prepares the first step, if needed; calls `told` with the share that is done, 0 to 1.
    ///
    /// # Errors
    ///
    /// If the run cannot begin.
    fn prepare(&mut self, _told: &mut dyn FnMut(f64)) -> anyhow::Result<()> {
        Ok(())
    }

    /// The start, then the result of each step; `None` after the last.
    ///
    /// # Errors
    ///
    /// The errors of the problem.
    fn next_async(&mut self) -> Coming<'_>;

    /// [`next_async`](Run::next_async), blocking until the frame is ready; in a browser not for a GPU.
    ///
    /// # Errors
    ///
    /// The errors of the problem.
    fn next(&mut self) -> anyhow::Result<Option<Frame>> {
        read_sync(self.next_async())
    }
}

/// State of a run after a step, for display.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Frame {
    /// Steps taken so far.
    pub step: usize,
    /// Progress along the schedule, 0 to 1.
    pub progress: f64,
    /// Scale of the softness, in NDC (NDC² if squared).
    pub scale: f64,
    /// The total loss.
    pub loss: f64,
    /// The loss of the hard image.
    pub hard_loss: f64,
    /// Angle between the camera and that of the target in degrees, if that is known.
    pub angle_deg: Option<f64>,
    /// The camera, if there is one.
    pub camera: Option<CameraView>,
    /// Number of the start, counted from 0, and number of starts; 0 if unknown.
    pub start: [usize; 2],
    /// Parameters of the scene.
    pub theta: Vec<f64>,
    /// The soft image `[size * size]`, top row first, 0 to 255.
    #[serde(skip)]
    pub soft: Vec<u8>,
    /// The hard image `[size * size]`, top row first, 0 to 255.
    #[serde(skip)]
    pub hard: Vec<u8>,
}

impl Frame {
    /// The frame of an iterate of one instance with its hard image `[size * size]`, without a camera.
    pub(crate) fn new(iterate: &Iterate, hard: &[f64], theta: Vec<f64>) -> Self {
        Self {
            step: iterate.step,
            progress: iterate.progress,
            scale: iterate.scale,
            loss: iterate.loss[0],
            hard_loss: iterate.hard_loss[0],
            angle_deg: None,
            camera: None,
            start: [iterate.restarts, 0],
            theta,
            soft: bytes(iterate.image.as_deref().unwrap_or_default()),
            hard: bytes(hard),
        }
    }
}

/// Levels from 0 to 1 as bytes.
pub(crate) fn bytes(levels: &[f64]) -> Vec<u8> {
    levels.iter().map(|level| (level.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
}
