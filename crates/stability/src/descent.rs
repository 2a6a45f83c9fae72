use std::sync::Arc;

use burn::{backend::Autodiff, tensor::Tensor};
use softrast_meta::{Adam, Optimizer};
use softrast_method::{Method, MovingSilhouette, numbers};
use softrast_raster::{Rasterizer, hard_silhouette, iou_loss, mse_loss};

use crate::drawn::Single;

type A = Autodiff<Single>;

/// Adam on scenes that no task draws from its seeds, with the silhouettes and losses of the tasks.
pub(crate) struct Descent<'a> {
    pub(crate) method: &'a Method,
    pub(crate) faces: &'a Arc<[[u32; 3]]>,
    pub(crate) size: usize,
    pub(crate) steps: usize,
    pub(crate) learning_rate: f64,
    pub(crate) loss: Loss,
    /// What the loss is multiplied by before its gradient is taken.
    pub(crate) factor: f64,
}

/// What is lowered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Loss {
    Iou,
    Mse,
}

/// Where a descent came to.
pub(crate) struct Descended {
    /// Hard loss of each view after each step.
    hard: Vec<Vec<f64>>,
    /// Parameters after each step.
    thetas: Vec<Vec<f64>>,
    /// Every loss, parameter and gradient.
    pub(crate) numbers: Vec<f64>,
}

impl Descent<'_> {
    /// Goes down from `start` `[N]` to images of `target` `[views, size, size]`; `project` places the
    /// corners of the faces, `allowed` moves parameters to where they may be.
    pub(crate) fn run(
        &self,
        start: Tensor<Single, 1>,
        target: &Tensor<Single, 3>,
        project: impl Fn(Tensor<A, 1>) -> Tensor<A, 3>,
        allowed: impl Fn(Tensor<Single, 1>) -> Tensor<Single, 1>,
    ) -> Descended {
        let adam = Adam::new(self.learning_rate);
        let mut state = adam.init(&start);
        let mut theta = start;
        let rasterizer = Rasterizer::new(self.size);
        let first = self.method.scale(0, self.steps);
        let mut silhouette = MovingSilhouette::<A>::new(self.method, rasterizer, self.faces, first);
        let mut end = Descended { hard: Vec::new(), thetas: Vec::new(), numbers: Vec::new() };
        for step in 0..=self.steps {
            silhouette.turn_to(self.method.scale(step, self.steps));
            let leaf = Tensor::from_inner(theta.clone()).require_grad();
            let vertices = project(leaf.clone());
            let loss = self
                .loss
                .of(silhouette.image(vertices.clone()), Tensor::from_inner(target.clone()));
            let hard = hard_silhouette(vertices.inner(), self.faces, self.size);
            let hard = numbers(self.loss.of_hard(hard, target.clone()));
            end.numbers.extend(numbers(loss.clone().inner()).iter().chain(&hard));
            end.numbers.extend(numbers(theta.clone()));
            end.thetas.push(numbers(theta.clone()));
            end.hard.push(hard);
            if step == self.steps {
                break;
            }
            let grads = (loss.sum() * self.factor).backward();
            let grad = leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like());
            end.numbers.extend(numbers(grad.clone()));
            let (moved, next) = adam.step(theta, grad, state);
            (theta, state) = (allowed(moved), next);
        }
        end
    }
}

impl Loss {
    fn of(self, image: Tensor<A, 3>, target: Tensor<A, 3>) -> Tensor<A, 1> {
        match self {
            Self::Iou => iou_loss(image, target),
            Self::Mse => mse_loss(image, target),
        }
    }

    fn of_hard(self, image: Tensor<Single, 3>, target: Tensor<Single, 3>) -> Tensor<Single, 1> {
        match self {
            Self::Iou => iou_loss(image, target),
            Self::Mse => mse_loss(image, target),
        }
    }
}

impl Descended {
    /// The step after which the hard image of a view is best; the last of equal ones.
    fn best_step(&self, view: usize) -> usize {
        let last_best = |best: usize, step: usize| {
            if self.hard[step][view] <= self.hard[best][view] { step } else { best }
        };
        (0..self.hard.len()).fold(0, last_best)
    }

    /// Parameters of a view at its best step: its share of the vector.
    pub(crate) fn best(&self, view: usize) -> &[f64] {
        let theta = &self.thetas[self.best_step(view)];
        let share = theta.len() / self.hard[0].len();
        &theta[view * share..(view + 1) * share]
    }

    /// Lowest hard loss of a view.
    pub(crate) fn lowest(&self, view: usize) -> f64 {
        self.hard[self.best_step(view)][view]
    }

    /// Parameters after the last step.
    pub(crate) fn last(&self) -> &[f64] {
        self.thetas.last().map_or(&[], Vec::as_slice)
    }
}
