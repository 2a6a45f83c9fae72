use std::sync::Arc;

use burn::Tensor;
use softrast::{
    raster::{Projected, RasterBackend, SoftRenderer},
    softness::Softness,
    tensor::Tensor as Inner,
};

use crate::{
    extension::{of_one, of_two},
    op::{Function, Of},
};

/// Draws soft silhouettes of one mesh topology: a [`SoftRenderer`] for tensors of burn 0.22.
///
/// Vertices must be projected, as by [`project`](crate::project).
#[derive(Clone, Debug)]
pub struct Silhouettes<S>(Arc<SoftRenderer<S>>);

/// A scalar function of silhouettes, for [`Silhouettes::hvp`].
#[derive(Clone, Debug)]
pub enum Objective {
    /// The sum of the image times these weights, `[views, height, width]`.
    Weighted(Tensor<3>),
    /// The sum over views of the [`iou_loss`](Silhouettes::iou_loss) against this target, `[1 or views, height, width]`.
    Iou(Tensor<3>),
    /// The sum over views of the [`mse_loss`](Silhouettes::mse_loss) against this target, `[1 or views, height, width]`.
    Mse(Tensor<3>),
}

impl<S: Softness> Silhouettes<S> {
    /// Wraps a renderer.
    pub fn new(renderer: SoftRenderer<S>) -> Self {
        Self(Arc::new(renderer))
    }

    /// The renderer.
    pub fn renderer(&self) -> &SoftRenderer<S> {
        &self.0
    }

    /// The renderer, to change its width for example. Images drawn before keep their gradients.
    pub fn renderer_mut(&mut self) -> &mut SoftRenderer<S> {
        Arc::make_mut(&mut self.0)
    }

    /// Draws coverage `[views, height, width]` in [0, 1], top row first, of `vertices` `[views, vertices, 3]`, which receive gradients.
    ///
    /// # Panics
    ///
    /// If the last axis of the vertices is not 3.
    pub fn silhouette(&self, vertices: Tensor<3>) -> Tensor<3> {
        of_one(self.coverage(), vertices)
    }

    /// The `IoU` loss of the silhouettes of `vertices` `[views, vertices, 3]` against a `target` `[1 or views, height, width]`: 1
    /// minus intersection over union per view, `[views]`. Only the vertices receive gradients.
    ///
    /// # Panics
    ///
    /// If the target has another size, or the last axis of the vertices is not 3.
    pub fn iou_loss(&self, vertices: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
        of_two(self.loss(Kind::Iou), [vertices, target.inner()])
    }

    /// The mean squared error per view, `[views]`, with the shapes and gradients of [`iou_loss`](Silhouettes::iou_loss).
    ///
    /// # Panics
    ///
    /// If the target has another size, or the last axis of the vertices is not 3.
    pub fn mse_loss(&self, vertices: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
        of_two(self.loss(Kind::Mse), [vertices, target.inner()])
    }

    /// Derivative of the silhouette as `vertices` move along `direction`, both
    /// `[views, vertices, 3]`: `[views, height, width]`, without gradients.
    ///
    /// # Panics
    ///
    /// If the shapes do not fit.
    pub fn jvp(&self, vertices: Tensor<3>, direction: Tensor<3>) -> Tensor<3> {
        let [vertices, direction] = alike(vertices, direction);
        let device = vertices.device();
        let data = Of(self.coverage()).jvp(vec![vertices.into_data()], direction.into_data());
        let dtype = data.dtype();
        Tensor::from_data(data, (&device, dtype))
    }

    /// The Hessian of an objective with respect to `vertices`, times `direction`, both `[views, vertices, 3]`, as is the product, which has
    /// no gradients. This and [`jvp`](Self::jvp) are for renderers without a surrogate, whose backward pass is not that of their image.
    ///
    /// # Panics
    ///
    /// If the shapes do not fit.
    pub fn hvp(&self, vertices: Tensor<3>, direction: Tensor<3>, of: &Objective) -> Tensor<3> {
        let [vertices, direction] = alike(vertices, direction);
        let device = vertices.device();
        let (vertices, direction) = (vertices.into_data(), direction.into_data());
        let to = |target: &Tensor<3>| vec![vertices.clone(), target.to_data()];
        let data = match of {
            Objective::Weighted(weights) => {
                Of(self.coverage()).hvp(vec![vertices], Some(weights.to_data()), direction)
            }
            Objective::Iou(target) => Of(self.loss(Kind::Iou)).hvp(to(target), None, direction),
            Objective::Mse(target) => Of(self.loss(Kind::Mse)).hvp(to(target), None, direction),
        };
        let dtype = data.dtype();
        Tensor::from_data(data, (&device, dtype))
    }

    fn coverage(&self) -> Coverage<S> {
        Coverage(self.0.clone())
    }

    fn loss(&self, kind: Kind) -> Loss<S> {
        Loss(self.0.clone(), kind)
    }
}

impl<S: Softness> From<SoftRenderer<S>> for Silhouettes<S> {
    fn from(renderer: SoftRenderer<S>) -> Self {
        Self::new(renderer)
    }
}

/// Checks that both shapes are equal, and detaches both tensors.
fn alike(vertices: Tensor<3>, direction: Tensor<3>) -> [Tensor<3>; 2] {
    assert_eq!(vertices.dims(), direction.dims(), "vertices and their direction have one shape");
    [vertices.inner(), direction.inner()]
}

#[derive(Debug)]
struct Coverage<S>(Arc<SoftRenderer<S>>);

impl<S: Softness> Function<3> for Coverage<S> {
    const MOVING: usize = 1;

    fn value<B: RasterBackend>(&self, inputs: Vec<Inner<B, 3>>) -> Inner<B, 3> {
        let [vertices] = inputs.try_into().expect("a silhouette has one input");
        self.0.silhouette(Projected::new(vertices))
    }
}

#[derive(Debug)]
struct Loss<S>(Arc<SoftRenderer<S>>, Kind);

#[derive(Clone, Copy, Debug)]
enum Kind {
    Iou,
    Mse,
}

impl<S: Softness> Function<1> for Loss<S> {
    const MOVING: usize = 1;

    fn value<B: RasterBackend>(&self, inputs: Vec<Inner<B, 3>>) -> Inner<B, 1> {
        let [vertices, target] = inputs.try_into().expect("a loss has vertices and a target");
        let vertices = Projected::new(vertices);
        match self.1 {
            Kind::Iou => self.0.iou_loss(vertices, target),
            Kind::Mse => self.0.mse_loss(vertices, target),
        }
    }
}
