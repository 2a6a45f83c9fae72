use burn::{
    backend::{Autodiff, NdArray},
    tensor::Tensor,
};
use softrast_method::{Method, MovingSilhouette, numbers, tensor};
use softrast_raster::{RasterBackend, Rasterizer, TConorm, reference};

use crate::flat::{Flat, Random};

/// The backend in which the exact answer is found.
pub(crate) type Exact = NdArray<f64>;
/// The backend in which tasks run.
pub(crate) type Single = NdArray<f32>;

/// Steps of a scale that decays. Few enough to leave the table, before it is made anew, as far behind
/// the scale as it ever gets: the last step narrows it by 4.5 %.
const STEPS: usize = 50;

/// A picture of a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawing<'a> {
    pub(crate) method: &'a Method,
    pub(crate) flat: &'a Flat,
    pub(crate) size: usize,
    pub(crate) tolerance: f64,
}

/// An image, and the gradient of a fixed weighted sum of its pixels to x, y and depth of the corners.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Drawn {
    pub(crate) image: Vec<f64>,
    pub(crate) gradient: Vec<f64>,
}

impl<'a> Drawing<'a> {
    /// At the tolerance of all tasks.
    pub(crate) fn new(method: &'a Method, flat: &'a Flat, size: usize) -> Self {
        Self { method, flat, size, tolerance: Rasterizer::TOLERANCE }
    }

    /// As tasks draw it, with the table that a scale that decays leaves behind.
    pub(crate) fn fused<B: RasterBackend>(&self) -> Drawn {
        self.painter::<B>().draw(self.flat, &weights(self.size))
    }

    /// All that it takes to draw other corners of the same faces; costs more than an image.
    pub(crate) fn painter<B: RasterBackend>(&self) -> Painter<B> {
        let rasterizer = Rasterizer { tolerance: self.tolerance, ..Rasterizer::new(self.size) };
        let scale = |step| self.method.scale(step, STEPS);
        let faces = &self.flat.faces;
        let mut silhouette =
            MovingSilhouette::new(self.method, rasterizer, faces, scale(STEPS - 2));
        silhouette.turn_to(scale(STEPS));
        Painter { silhouette, size: self.size }
    }

    /// By the definition, over all pairs, in f64.
    pub(crate) fn dense(&self) -> Drawn {
        let conorm = TConorm::Probabilistic;
        let phi = self.method.phi(self.method.scale(STEPS, STEPS));
        let phi = tensor::<Autodiff<Exact>, 1>(phi.clone(), [phi.len()]);
        let softness = self.method.softness();
        let scene = reference::Scene { faces: &self.flat.faces, size: self.size };
        drawn::<Exact>(self.flat, self.size, &weights(self.size), |vertices| {
            conorm.coverage(reference::sums(scene, vertices, &softness, conorm, phi))
        })
    }
}

/// Draws faces wherever their corners are.
pub(crate) struct Painter<B: RasterBackend> {
    silhouette: MovingSilhouette<Autodiff<B>>,
    size: usize,
}

impl<B: RasterBackend> Painter<B> {
    /// The image of `flat`, and the gradient of the sum of its pixels times `weights`
    /// `[size * size]`.
    pub(crate) fn draw(&self, flat: &Flat, weights: &[f64]) -> Drawn {
        drawn::<B>(flat, self.size, weights, |vertices| self.silhouette.image(vertices))
    }
}

fn drawn<B: RasterBackend>(
    flat: &Flat,
    size: usize,
    weights: &[f64],
    image: impl FnOnce(Tensor<Autodiff<B>, 3>) -> Tensor<Autodiff<B>, 3>,
) -> Drawn {
    let vertices = tensor::<B, 3>(flat.corners.concat(), [1, flat.corners.len(), 3]);
    let leaf = Tensor::<Autodiff<B>, 3>::from_inner(vertices.clone()).require_grad();
    let image = image(leaf.clone());
    let weights = tensor(weights.to_vec(), [1, size, size]);
    let grads = (image.clone() * weights).sum().backward();
    let gradient = leaf.grad(&grads).unwrap_or_else(|| vertices.zeros_like());
    Drawn { image: numbers(image.inner()), gradient: numbers(gradient) }
}

impl Drawn {
    /// Largest difference of a pixel; NaN if one is not a number.
    pub(crate) fn off(&self, other: &Self) -> f64 {
        largest(self.image.iter().zip(&other.image).map(|(a, b)| a - b))
    }

    /// Length of the difference of the gradients over that of the other, or over `least` if that is
    /// longer.
    pub(crate) fn gradient_off(&self, other: &Self, least: f64) -> f64 {
        let length = |of: &mut dyn Iterator<Item = f64>| of.map(|x| x * x).sum::<f64>().sqrt();
        let pairs = self.gradient.iter().zip(&other.gradient);
        length(&mut pairs.map(|(a, b)| a - b))
            / length(&mut other.gradient.iter().copied()).max(least)
    }

    /// All numbers.
    pub(crate) fn all(&self) -> Vec<f64> {
        self.image.iter().chain(&self.gradient).copied().collect()
    }
}

/// Largest size of a number; NaN if one is.
pub(crate) fn largest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let most =
        |most: f64, x: f64| if most.is_nan() || x.is_nan() { f64::NAN } else { most.max(x.abs()) };
    numbers.into_iter().fold(0.0, most)
}

/// Weights of the pixels, from -1 to 1, that single out no part of the image.
pub(crate) fn weights(size: usize) -> Vec<f64> {
    let mut random = Random::new(17);
    (0..size * size).map(|_| random.within(1.0)).collect()
}
