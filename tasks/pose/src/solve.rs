use std::{sync::Arc, time::Instant};

use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData},
};
use softrast_meta::{Adam, Optimizer};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette, iou_loss};
use softrast_softness::EdgeSoftness;

use crate::{
    Method, Scene,
    scene::{numbers, tensor},
};

/// A scale may fall by this factor before support and knots are chosen anew.
const STALE: f64 = 0.95;

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
        let mut renderer = Renderer::<B>::new(self, scene.faces());
        let mut seconds = None;
        for step in 0..=self.steps {
            let clock = Instant::now();
            let scale = self.method.scale(step, self.steps);
            renderer.turn_to(scale);
            let leaf = Tensor::from_inner(theta.clone()).require_grad();
            let projected = scene.project(leaf.clone());
            let image = renderer.image(projected.clone());
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

/// Draws soft silhouettes at a scale that moves.
struct Renderer<'a, B: RasterBackend> {
    method: &'a Method,
    size: usize,
    faces: &'a Arc<[[u32; 3]]>,
    silhouette: Silhouette<EdgeSoftness>,
    /// The scale that support and knots of `silhouette` were chosen for.
    prepared: f64,
    table: Tensor<Autodiff<B>, 2>,
    /// The scale of `table`.
    scale: f64,
}

impl<'a, B: RasterBackend> Renderer<'a, B> {
    fn new(solver: &'a Solver, faces: &'a Arc<[[u32; 3]]>) -> Self {
        let Solver { method, size, .. } = solver;
        let scale = method.scale(0, solver.steps);
        let phi = Self::phi(method, scale);
        let silhouette = Rasterizer::new(*size).prepare(faces, method.softness(), &phi);
        let table = silhouette.table(phi);
        Self { method, size: *size, faces, silhouette, prepared: scale, table, scale }
    }

    /// Makes the next images at `scale`, with as little work as that takes.
    fn turn_to(&mut self, scale: f64) {
        if self.scale == scale {
            return;
        }
        let phi = Self::phi(self.method, scale);
        if !(STALE..=1.0).contains(&(scale / self.prepared)) {
            let rasterizer = Rasterizer::new(self.size);
            self.silhouette = rasterizer.prepare(self.faces, self.method.softness(), &phi);
            self.prepared = scale;
        }
        (self.table, self.scale) = (self.silhouette.table(phi), scale);
    }

    fn image(&self, projected: Tensor<Autodiff<B>, 3>) -> Tensor<Autodiff<B>, 3> {
        self.silhouette.coverage_by_table(projected, self.table.clone())
    }

    fn phi(method: &Method, scale: f64) -> Tensor<Autodiff<B>, 1> {
        let phi = method.phi(scale);
        let shape = [phi.len()];
        tensor(phi, shape)
    }
}
