use std::sync::Arc;

use burn::Tensor;
use softrast::{
    raster::{Attributes, ColourRenderer, Projected, RasterBackend},
    softness::Softness,
    tensor::Tensor as Inner,
};

use crate::{extension::of_two, op::Function};

/// Draws soft colours of one mesh topology before a constant background: a [`ColourRenderer`] for tensors of burn 0.22.
///
/// ```
/// use softrast_burn::{Colours, burn::tensor::{Device, Tensor}, softrast::prelude::*};
///
/// let device = Device::flex().autodiff();
/// let faces = [[0, 1, 2]];
/// let renderer = ColourRenderer::new(&faces, 16, Family::Logistic, 0.01, [1.0, 4.0]);
/// let colours = Colours::new(renderer, &faces, &[0.0, 0.0, 1.0]);
/// let seen = Tensor::<3>::from_floats([[[-0.5, -0.5, 2.0], [0.5, -0.5, 2.0], [0.0, 0.5, 3.0]]], &device);
/// let red = Tensor::<3>::from_floats([[[1.0, 0.0, 0.0]; 3]], &device).require_grad();
/// let image = colours.image(seen, red.clone());
/// assert_eq!(image.dims(), [1, 4, 16, 16]); // red, green, blue, and the share of the faces
/// assert_eq!(red.grad(&image.mean().backward()).unwrap().dims(), [1, 3, 3]);
/// ```
#[derive(Clone, Debug)]
pub struct Colours<S>(Arc<Scene<S>>);

#[derive(Debug)]
struct Scene<S> {
    renderer: ColourRenderer<S>,
    faces: Arc<[[u32; 3]]>,
    background: Vec<f64>,
}

impl<S: Softness> Colours<S> {
    /// Wraps a renderer for vertex attributes; `faces` must be those of the renderer, and `background` `[channels]` is
    /// the colour behind them, with the weight of [`ColourRenderer::background`].
    pub fn new(renderer: ColourRenderer<S>, faces: &[[u32; 3]], background: &[f64]) -> Self {
        let (faces, background) = (faces.into(), background.to_vec());
        Self(Arc::new(Scene { renderer, faces, background }))
    }

    /// The renderer.
    pub fn renderer(&self) -> &ColourRenderer<S> {
        &self.0.renderer
    }

    /// Draws the blended channels and, last, the share of the faces, `[views, channels + 1, height, width]`, top row first. `vertices`
    /// `[views, vertices, 3]` are projected, `attributes` are `[1 or views, vertices, channels]`; both receive gradients.
    ///
    /// # Panics
    ///
    /// If the shapes do not fit.
    pub fn image(&self, vertices: Tensor<3>, attributes: Tensor<3>) -> Tensor<4> {
        of_two(Blend(self.0.clone()), [vertices, attributes])
    }
}

#[derive(Debug)]
struct Blend<S>(Arc<Scene<S>>);

impl<S: Softness> Function<4> for Blend<S> {
    const MOVING: usize = 2;

    fn value<B: RasterBackend>(&self, inputs: Vec<Inner<B, 3>>) -> Inner<B, 4> {
        let [vertices, values] = inputs.try_into().expect("an image has vertices and attributes");
        let Scene { renderer, faces, background } = &*self.0;
        let background = renderer.background(background, &vertices.device());
        let attributes = Attributes::new(values, faces.clone());
        renderer.image(Projected::new(vertices), &attributes, &background)
    }
}
