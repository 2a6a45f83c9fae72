use std::time::Instant;

use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData},
};
use softrast_meta::{Adam, Optimizer};
use softrast_method::{Method, MovingSilhouette, numbers};
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
        let adam = Adam::new(self.learning_rate);
        let target = scene.target().inner();
        let mut theta = scene.start().inner();
        let mut moments = adam.init(&theta);
        let first = self.method.scale(0, self.steps);
        let rasterizer = Rasterizer::new(self.size);
        let mut silhouette =
            MovingSilhouette::<Autodiff<B>>::new(&self.method, rasterizer, scene.faces(), first);
        let mut seconds = None;
        for step in 0..=self.steps {
            let clock = Instant::now();
            let scale = self.method.scale(step, self.steps);
            silhouette.turn_to(scale);
            let leaf = Tensor::from_inner(theta.clone()).require_grad();
            let projected = scene.project(leaf.clone());
            let image = silhouette.image(projected.clone());
            let loss = iou_loss(image.clone(), scene.target());
            let mut time = clock.elapsed();

            let hard = iou_loss(scene.hard(projected).inner(), target.clone());
            visit(State {
                step,
                scale,
                theta: numbers(theta.clone()).chunks(theta.dims()[1]).map(<[_]>::to_vec).collect(),
                soft: numbers(loss.clone().inner()),
                hard: numbers(hard),
                image: image.into_data(),
                seconds,
            })?;
            if step == self.steps {
                break;
            }
            let clock = Instant::now();
            let grads = loss.sum().backward();
            // No gradient at all where nothing was drawn: the pose then stays.
            let grad = leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like());
            let (moved, next) = adam.step(theta, grad, moments);
            (theta, moments) = (scene.allowed(Tensor::from_inner(moved)).inner(), next);
            time += clock.elapsed();
            seconds = Some(time.as_secs_f64());
        }
        Ok(())
    }
}
