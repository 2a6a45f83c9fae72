use std::pin::Pin;

use serde::Serialize;
use softrast_inverse::Iterate;
use softrast_tensor::read_sync;

use crate::CameraView;

/// A frame that will come; from the CPU it comes at once.
pub type Coming<'a> = Pin<Box<dyn Future<Output = anyhow::Result<Option<Frame>>> + 'a>>;

/// A run that goes on when it is asked to.
pub trait Run {
    /// Pixels a side of its images.
    fn size(&self) -> usize;

    /// Steps of the whole run.
    fn steps(&self) -> usize;

    /// What it should arrive at, `[size * size]`, top row first, in [0, 1].
    fn target(&self) -> Vec<f64>;

    /// The camera of the target, if it is known.
    fn truth(&self) -> Option<CameraView> {
        None
    }

    /// What has to be found out before the first step, if anything; `told` hears which share of that is done, 0 to 1.
    ///
    /// # Errors
    ///
    /// If the run cannot begin.
    fn prepare(&mut self, _told: &mut dyn FnMut(f64)) -> anyhow::Result<()> {
        Ok(())
    }

    /// The start, then what comes of each step; none after the last.
    ///
    /// # Errors
    ///
    /// Those of the problem.
    fn next_async(&mut self) -> Coming<'_>;

    /// The same where nothing has to be waited for, or this thread may wait.
    ///
    /// # Errors
    ///
    /// Those of the problem.
    fn next(&mut self) -> anyhow::Result<Option<Frame>> {
        read_sync(self.next_async())
    }
}

/// What there is to see after a step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Frame {
    /// Steps taken so far.
    pub step: usize,
    /// Where on its path the softness is, 0 to 1.
    pub progress: f64,
    /// Its scale, in NDC (NDC² if squared).
    pub scale: f64,
    /// What is lowered.
    pub loss: f64,
    /// What is wrong with the hard image.
    pub hard_loss: f64,
    /// Angle between the camera and that of the target in degrees, if that is known.
    pub angle_deg: Option<f64>,
    /// The camera, if there is one.
    pub camera: Option<CameraView>,
    /// Which start this is, counted from 0, and of how many; of 0 if that is not known.
    pub start: [usize; 2],
    /// The scene, as the optimiser has it.
    pub theta: Vec<f64>,
    /// The soft image `[size * size]`, top row first, 0 to 255.
    #[serde(skip)]
    pub soft: Vec<u8>,
    /// The hard image, alike.
    #[serde(skip)]
    pub hard: Vec<u8>,
}

impl Frame {
    /// What there is to see of an iterate of one instance, with its hard image `[size * size]`, but for a camera.
    pub(crate) fn new(iterate: &Iterate, hard: &[f64], theta: Vec<f64>) -> Self {
        Self {
            step: iterate.step,
            progress: iterate.progress,
            scale: iterate.scale,
            loss: iterate.loss[0],
            hard_loss: iterate.hard_loss[0],
            angle_deg: None,
            camera: None,
            start: [iterate.begun_again, 0],
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
