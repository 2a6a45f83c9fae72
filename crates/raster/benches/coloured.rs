//! A workload drawn in colour, with its gradient.

use std::{sync::Arc, time::Instant};

use softrast_raster::{
    Attributes, Background, ColourRenderer, Projected, RasterBackend, Weighting, mse_loss, project,
};
use softrast_softness::{DepthSoftness, Family, Softness};
use softrast_tensor::{Autodiff, DType, Tensor};

use crate::workload::{Workload, disk, tensor};

/// Depths around a mesh at distance 2.732.
const PLANES: [f64; 2] = [1.7, 3.8];
/// Channels.
pub(crate) const COLOURS: usize = 3;

/// A workload in one float type, with waves of colour over its vertices.
#[derive(Clone)]
pub(crate) struct Coloured<B: RasterBackend> {
    renderer: ColourRenderer,
    world: Tensor<B, 3>,
    cameras: Tensor<B, 2>,
    colours: Attributes<B>,
    picture: Tensor<B, 4>,
    faces: Arc<[[u32; 3]]>,
}

impl<B: RasterBackend> Coloured<B> {
    /// The workload with its edge softness, and a depth softness of this scale in units of the distance between the planes.
    pub(crate) fn new(workload: &Workload, depth_scale: f64, dtype: DType) -> Self {
        let world = workload.world::<B>(dtype);
        let [_, vertices, _] = world.dims();
        let edge = workload.softness;
        let depth = DepthSoftness::Family(Family::Exp);
        let phi =
            [edge.default_phi(workload.width * workload.width), depth.default_phi(depth_scale)];
        let weighting = Weighting { edge, depth, planes: PLANES };
        let (faces, size) = (workload.faces.clone(), workload.size);
        let wave = |k: usize| 0.5 + 0.5 * (0.1 * k as f64).sin();
        let colours: Vec<f64> = (0..COLOURS * vertices).map(wave).collect();
        let mask = tensor::<B, 4>(&disk(size), [1, 1, size, size], dtype);
        Self {
            renderer: ColourRenderer::with_weighting(faces.clone(), size, weighting, phi),
            world,
            cameras: workload.cameras(dtype),
            colours: Attributes::new(
                tensor(&colours, [1, vertices, COLOURS], dtype),
                faces.clone(),
            ),
            picture: mask.repeat_dim(1, COLOURS + 1),
            faces,
        }
    }

    pub(crate) fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.renderer = self.renderer.with_tolerance(tolerance);
        self
    }

    pub(crate) fn without_back_faces(mut self) -> Self {
        self.renderer = self.renderer.without_back_faces();
        self
    }

    /// The image, without gradients: `[views, channels + 1, height, width]`.
    pub(crate) fn image(&self) -> Tensor<B, 4> {
        let seen = project(self.world.clone(), self.cameras.clone());
        let device = &self.world.device();
        let background = self.renderer.background(&[0.0; COLOURS], device);
        self.renderer.image(seen, &self.colours, &background)
    }

    /// The gradients of a step whose loss is one op with the image, with respect to the world vertices and their colours.
    pub(crate) fn fused_step(&self) -> [Tensor<B, 3>; 2] {
        let Tracked { world, colours, seen, attributes, background } = self.tracked();
        let picture = Tensor::from_inner(self.picture.clone());
        let loss = self.renderer.mse_loss(seen, &attributes, &background, picture);
        let gradients = loss.mean().backward();
        [&world, &colours].map(|of| of.grad(&gradients).expect("it is seen"))
    }

    /// The image, its gradients with respect to the world vertices and their colours, and the milliseconds of both.
    pub(crate) fn step(&self) -> (Tensor<B, 4>, [Tensor<B, 3>; 2], f64) {
        let start = Instant::now();
        let Tracked { world, colours, seen, attributes, background } = self.tracked();
        let image = self.renderer.image(seen, &attributes, &background);
        let gradients =
            mse_loss(image.clone(), Tensor::from_inner(self.picture.clone())).mean().backward();
        let both = [&world, &colours].map(|of| of.grad(&gradients).expect("it is seen"));
        (image.inner(), both, start.elapsed().as_secs_f64() * 1e3)
    }

    fn tracked(&self) -> Tracked<Autodiff<B>> {
        let tracked = |tensor: &Tensor<B, 3>| {
            Tensor::<Autodiff<B>, 3>::from_inner(tensor.clone()).require_grad()
        };
        let (world, colours) = (tracked(&self.world), tracked(self.colours.values()));
        Tracked {
            seen: project(world.clone(), Tensor::from_inner(self.cameras.clone())),
            attributes: Attributes::new(colours.clone(), self.faces.clone()),
            background: self.renderer.background(&[0.0; COLOURS], &world.device()),
            world,
            colours,
        }
    }
}

/// A workload with gradients to the world vertices and their colours.
struct Tracked<A: RasterBackend> {
    world: Tensor<A, 3>,
    colours: Tensor<A, 3>,
    seen: Projected<A>,
    attributes: Attributes<A>,
    background: Background<A>,
}
