use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_raster::RasterBackend;
use softrast_runner::Figure;

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

    /// What the inner loop lowers at a step, `[1]`.
    fn loss<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        drawing: &Self::Drawing,
        theta: Tensor<B, 1>,
        phi: Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1>;

    /// What is wrong with the image at θ under a fixed softness so narrow that no other can flatter
    /// itself, `[1]`; the scene is one with [`FINER`] times as many pixels a side.
    fn judge<B: RasterBackend>(&self, scene: &Self::Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1>;

    /// Files for the command line: name and text.
    ///
    /// # Errors
    ///
    /// If φ is not what a file may hold.
    fn files(&self, phi: &[f64], note: &str) -> anyhow::Result<Vec<(&'static str, String)>>;

    /// The learned functions beside those of the start.
    fn figures(&self, phi: &[f64]) -> Vec<Figure>;
}

/// Pixels a side of the image that judges, over those of the image that is optimised.
///
/// Source: META 2.4.
pub const FINER: usize = 2;

/// Largest error of a pixel while learning. The default is good enough for an image, but the second
/// derivative of a table is its least exact one (META 2.3).
pub const LEARNING_TOLERANCE: f64 = 1e-9;
