use std::sync::Arc;

use softrast_meta::Adam;
use softrast_raster::RasterBackend;
use softrast_softness::Softness;
use softrast_tensor::Tensor;

use crate::SoftnessAt;

/// A problem of inverse rendering: find the parameters θ of a scene whose image is that of a target.
///
/// It is implemented once, for solving and for learning a softness. Everything is generic over the backend: solving needs a scene on
/// its autodiff, learning on the autodiff of that too. θ is one flat vector that holds the parameters of all instances, one after the
/// other.
pub trait InverseProblem: 'static {
    /// What one run is asked: targets and a start, as plain numbers.
    type Instance: Clone;

    /// Some instances on a backend, to be solved side by side.
    type Scene<B: RasterBackend>;

    /// The instance of a seed, always the same one.
    ///
    /// # Errors
    ///
    /// If there is none.
    fn instance(&self, seed: u64) -> anyhow::Result<Self::Instance>;

    /// Another start for the same targets, number `k` of `count`, counted from 1; none if there is but one start.
    fn restart(
        &self,
        _instance: &Self::Instance,
        _k: usize,
        _count: usize,
    ) -> Option<Self::Instance> {
        None
    }

    /// Instances side by side, on images of `size` × `size` pixels.
    fn scene<B: RasterBackend>(&self, instances: &[Self::Instance], size: usize) -> Self::Scene<B>;

    /// Faces of the mesh whose silhouettes are seen, the same in all instances; none if edges are drawn in another way.
    fn faces(&self) -> Option<Arc<[[u32; 3]]>>;

    /// Parameters of a softness of the problem's own beside that of the edges, which is learned along with it.
    fn own_phi(&self) -> Vec<f64> {
        Vec::new()
    }

    /// θ before the first step, `[N]`.
    fn start<B: RasterBackend>(&self, scene: &Self::Scene<B>) -> Tensor<B, 1>;

    /// The nearest θ that is allowed.
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

    /// The soft image by which the result of learning is judged, under the narrow softness that it is given.
    fn sharp_image<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        self.image(scene, theta, softness)
    }

    /// What is wrong with an image, `[instances]`. It may have fewer pixels than the scene, whose number of pixels a side was halved
    /// some times.
    fn image_loss<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        image: Tensor<B, 4>,
    ) -> Tensor<B, 1>;

    /// [`image_loss`](Self::image_loss) of the [`image`](Self::image) at θ, where the image itself is not asked for.
    fn loss_at<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        self.image_loss(scene, self.image(scene, theta, softness))
    }

    /// A term added to the loss that keeps the scene regular, `[instances]`.
    fn regularizer<B: RasterBackend>(
        &self,
        _scene: &Self::Scene<B>,
        _theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        None
    }

    /// Size of the image, steps and learning rate unless somebody says otherwise.
    fn defaults(&self) -> SolveConfig;

    /// The optimiser that steps θ.
    fn optimizer(&self, learning_rate: f64) -> Adam {
        Adam::new(learning_rate)
    }
}

/// How a problem is solved, beside the method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveConfig {
    /// Width and height of the image by which results are judged, in pixels.
    pub size: usize,
    /// Steps of the optimiser.
    pub steps: usize,
    /// Its learning rate.
    pub learning_rate: f64,
}

/// The total loss `[instances]`: that of an image at θ, and the regularizer.
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
