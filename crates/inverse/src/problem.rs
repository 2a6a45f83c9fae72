use std::sync::Arc;

use softrast_meta::Adam;
use softrast_raster::{ImageSize, RasterBackend};
use softrast_softness::Softness;
use softrast_tensor::Tensor;

use crate::SoftnessAt;

/// A problem of inverse rendering: find the parameters θ of a scene whose image matches a target.
///
/// One implementation serves both solving and learning a softness. Everything is generic over the
/// backend: solving needs a scene on its autodiff backend, learning also on the autodiff of that. θ
/// is one flat vector that holds the parameters of all instances, one after the other.
pub trait InverseProblem: 'static {
    /// Targets and start of one run, as plain numbers.
    type Instance: Clone;

    /// Instances on a backend, to be solved together.
    type Scene<B: RasterBackend>;

    /// The instance of a seed, always the same.
    ///
    /// # Errors
    ///
    /// If there is none.
    fn instance(&self, seed: u64) -> anyhow::Result<Self::Instance>;

    /// Another start for the same targets, number `k` of `count`, counted from 1; `None` if there is only one start.
    fn restart(
        &self,
        _instance: &Self::Instance,
        _k: usize,
        _count: usize,
    ) -> Option<Self::Instance> {
        None
    }

    /// Height and width of images whose shorter side has `size` pixels; by default squares.
    fn image_size(&self, size: usize) -> ImageSize {
        size.into()
    }

    /// The scene of these instances, on images of [`image_size`](Self::image_size).
    fn scene<B: RasterBackend>(&self, instances: &[Self::Instance], size: usize) -> Self::Scene<B>;

    /// Faces of the mesh of the silhouettes, the same in all instances; `None` if edges are drawn differently.
    fn faces(&self) -> Option<Arc<[[u32; 3]]>>;

    /// Parameters of the problem's own softness, learned together with that of the edges.
    fn own_phi(&self) -> Vec<f64> {
        Vec::new()
    }

    /// θ before the first step, `[N]`.
    fn start<B: RasterBackend>(&self, scene: &Self::Scene<B>) -> Tensor<B, 1>;

    /// Projects θ onto the allowed parameters.
    fn allowed<B: RasterBackend>(
        &self,
        _scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 1> {
        theta
    }

    /// The soft image at θ, `[views, channels, height, width]`; a silhouette has one channel.
    fn image<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4>;

    /// The hard image at θ, shaped like the soft one; it has no gradient.
    fn hard_image<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 4>;

    /// The soft image of the outer loss, under the given narrow softness.
    fn sharp_image<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        self.image(scene, theta, softness)
    }

    /// The loss of an image `[views, channels, height, width]`, `[instances]`; its size is that of the scene, possibly halved repeatedly.
    fn image_loss<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        image: Tensor<B, 4>,
    ) -> Tensor<B, 1>;

    /// [`image_loss`](Self::image_loss) of the [`image`](Self::image) at θ, if the image itself is not needed.
    fn loss_at<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        self.image_loss(scene, self.image(scene, theta, softness))
    }

    /// A regularization term of the loss, `[instances]`.
    fn regularizer<B: RasterBackend>(
        &self,
        _scene: &Self::Scene<B>,
        _theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        None
    }

    /// Default size of the image, steps and learning rate.
    fn defaults(&self) -> SolveConfig;

    /// The optimiser of θ.
    fn optimizer(&self, learning_rate: f64) -> Adam {
        Adam::new(learning_rate)
    }
}

/// Settings for solving a problem, apart from the method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveConfig {
    /// Shorter side of the image of the hard error, in pixels.
    pub size: usize,
    /// Steps of the optimiser.
    pub steps: usize,
    /// Learning rate of the optimiser.
    pub learning_rate: f64,
}

/// The total loss `[instances]`: `image` loss at θ plus regularizer.
pub(crate) fn total_loss<P: InverseProblem, B: RasterBackend>(
    problem: &P,
    scene: &P::Scene<B>,
    theta: Tensor<B, 1>,
    image_loss: Tensor<B, 1>,
) -> Tensor<B, 1> {
    match problem.regularizer(scene, theta) {
        Some(regularizer) => image_loss + regularizer,
        None => image_loss,
    }
}
