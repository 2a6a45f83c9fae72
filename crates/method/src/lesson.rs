use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_raster::RasterBackend;
use softrast_runner::{Figure, Plan, Referee};

use crate::Step;

/// What a task has to say to have a softness learned on it.
///
/// The learned vector φ is the task's own: [`LearnedEdge`](crate::LearnedEdge) says what is in it for
/// an edge. Everything is generic over the backend, because learning needs a scene on a backend, on
/// its autodiff, and on the autodiff of that.
pub trait Lesson: 'static {
    /// One instance.
    type Scene<B: RasterBackend>;

    /// What is prepared once for all instances under a softness, such as the support of its profile.
    type Drawing;

    /// φ that learning starts from.
    fn start(&self) -> Vec<f64>;

    /// Refuses a plan that the softness cannot be learned by.
    ///
    /// # Errors
    ///
    /// A usage error.
    fn suits(&self, _plan: &Plan) -> anyhow::Result<()> {
        Ok(())
    }

    /// How an instance is solved.
    fn inner(&self) -> InnerLoop<Adam>;

    /// The instance of a seed, on images with `finer` times as many pixels a side.
    ///
    /// # Errors
    ///
    /// If there is no such instance.
    fn scene<B: RasterBackend>(&self, seed: u64, finer: usize) -> anyhow::Result<Self::Scene<B>>;

    /// Where the inner loop starts, flat.
    fn theta<B: RasterBackend>(&self, scene: &Self::Scene<B>) -> Tensor<B, 1>;

    /// The nearest θ that the instance allows.
    fn allowed<B: RasterBackend>(
        &self,
        _scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 1> {
        theta
    }

    /// Prepares to draw under a softness near `phi`.
    fn prepare(&self, phi: &[f64]) -> Self::Drawing;

    /// What the inner loop lowers at a step, `[1]`, from φ or what was prepared from it.
    fn loss<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        drawing: &Self::Drawing,
        theta: Tensor<B, 1>,
        phi: Tensor<B, 1>,
        step: Step,
    ) -> Tensor<B, 1>;

    /// What the loss at a step needs of φ, flat: φ itself unless something costly follows from it.
    fn prepared<B: RasterBackend>(
        &self,
        _drawing: &Self::Drawing,
        phi: Tensor<B, 1>,
        _step: usize,
    ) -> Tensor<B, 1> {
        phi
    }

    /// Steps with the same number in a row share what [`prepared`](Lesson::prepared) gives.
    fn stage(&self, _step: usize) -> usize {
        0
    }

    /// What is wrong with the image at θ under a fixed softness so narrow that no other can flatter
    /// itself, or with the hard image, `[1]`; the scene is one with [`finer`] times as many pixels a side.
    fn judge<B: RasterBackend>(&self, scene: &Self::Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1>;

    /// Files for the command line, of a softness that was learned at a learning rate of the inner loops: name and
    /// text.
    ///
    /// # Errors
    ///
    /// If φ is not what a file may hold.
    fn files(
        &self,
        phi: &[f64],
        learning_rate: f64,
        note: &str,
    ) -> anyhow::Result<Vec<(&'static str, String)>>;

    /// The learned functions beside those of the start.
    fn figures(&self, phi: &[f64]) -> Vec<Figure>;
}

/// Pixels a side of the image that judges, over those of the image that is optimised.
///
/// Source: META 2.4.
pub fn finer(plan: &Plan) -> usize {
    match plan.referee {
        Referee::Fixed | Referee::Own => 2,
        Referee::Pixels | Referee::Hard => 1,
    }
}

/// Largest error of a pixel while learning by derivatives, unless another is asked for.
///
/// The second derivative of a table of cubics is its least exact one, so that meta-gradients are off by up to a tenth
/// here, and by their own size at 1e-2 (`both_ways_to_draw_have_the_same_meta_gradient`).
pub const LEARNING_TOLERANCE: f64 = 1e-3;
