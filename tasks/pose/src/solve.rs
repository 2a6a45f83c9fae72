use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData},
};
use softrast_meta::Adam;
use softrast_method::{Descent, Method, MovingSilhouette, numbers};
use softrast_raster::{RasterBackend, Rasterizer, iou_loss};

use crate::Scene;

/// How to solve the instances of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Solver {
    pub(crate) method: Method,
    pub(crate) size: usize,
    pub(crate) steps: usize,
    pub(crate) learning_rate: f64,
}

/// All views after some steps.
pub(crate) struct State {
    pub(crate) step: usize,
    pub(crate) scale: f64,
    /// θ of each view.
    pub(crate) theta: Vec<Vec<f64>>,
    /// Soft `IoU` loss of each view, what the optimiser lowers.
    pub(crate) soft: Vec<f64>,
    /// `IoU` loss of the hard silhouette of each view.
    pub(crate) hard: Vec<f64>,
    /// Soft silhouettes, `[views, size, size]`.
    pub(crate) image: TensorData,
    /// Time of the step that ended here, in seconds; none before the first.
    pub(crate) seconds: Option<f64>,
}

impl Solver {
    /// Solves all views of `scene`, and shows each state from the start to the end to `visit`.
    pub(crate) fn run<B: RasterBackend>(
        &self,
        scene: &Scene<Autodiff<B>>,
        mut visit: impl FnMut(State) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let descent = Descent { optimizer: Adam::new(self.learning_rate), steps: self.steps };
        let target = scene.target().inner();
        let first = self.method.scale(0, self.steps);
        let rasterizer = Rasterizer::new(self.size);
        let mut silhouette =
            MovingSilhouette::<Autodiff<B>>::new(&self.method, rasterizer, scene.faces(), first);
        descent.run(
            scene.start().inner(),
            |step, theta| {
                let scale = self.method.scale(step, self.steps);
                silhouette.turn_to(scale);
                let projected = scene.project(theta);
                let image = silhouette.image(projected.clone());
                (iou_loss(image.clone(), scene.target()), (scale, projected, image))
            },
            |theta| scene.allowed(Tensor::from_inner(theta)).inner(),
            |now| {
                let (scale, projected, image) = now.seen;
                let poses = numbers(now.theta.clone());
                visit(State {
                    step: now.step,
                    scale,
                    theta: poses.chunks(now.theta.dims()[1]).map(<[_]>::to_vec).collect(),
                    soft: numbers(now.loss),
                    hard: numbers(iou_loss(scene.hard(projected).inner(), target.clone())),
                    image: image.into_data(),
                    seconds: now.seconds,
                })
            },
        )
    }
}
