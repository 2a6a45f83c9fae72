//! Images and gradients of planar scenes, as tasks draw them and by the definition.

use std::marker::PhantomData;

use softrast_inverse::{PhiLayout, Resolution, ScheduledRenderer, ScheduledSoftness};
use softrast_raster::{Projected, RasterBackend, TConorm, low_level::Rasterizer, reference};
use softrast_tensor::{Autodiff, NdArray, Tensor, numbers, tensor};

use crate::planar_scene::{PlanarScene, Random};

/// The backend of exact results.
pub type Exact = NdArray<f64>;
/// The backend in which tasks run.
pub type Single = NdArray<f32>;

/// Steps of a scale that decays to a tenth, by 4.6 % per step. At this number the table is almost as far behind the scale as it ever gets
/// before it is rebuilt.
const STEPS: usize = 50;

/// A request for a picture of a scene.
#[derive(Clone, Copy, Debug)]
pub struct RenderRequest<'a> {
    /// The softness, as at the last step if its scale moves.
    pub softness: &'a ScheduledSoftness,
    /// The scene.
    pub flat: &'a PlanarScene,
    /// Pixels a side.
    pub size: usize,
    /// Largest error of a pixel.
    pub tolerance: f64,
}

/// An image, and the gradient of a fixed weighted sum of its pixels with respect to x, y and depth of the corners.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Pixels, row by row.
    pub image: Vec<f64>,
    /// `[corners, 3]`.
    pub gradient: Vec<f64>,
}

impl<'a> RenderRequest<'a> {
    /// A request with the tolerance of all tasks.
    pub fn new(softness: &'a ScheduledSoftness, flat: &'a PlanarScene, size: usize) -> Self {
        Self { softness, flat, size, tolerance: Rasterizer::TOLERANCE }
    }

    /// Draws as tasks do, with the table that a decaying scale leaves behind.
    pub fn fused<B: RasterBackend>(&self) -> Drawn {
        self.renderer::<B>().draw(self.flat, &weights(self.size))
    }

    /// A renderer for other corners of the same faces; preparing it costs more than an image.
    pub fn renderer<B: RasterBackend>(&self) -> Renderer<B> {
        let rasterizer = Rasterizer { tolerance: self.tolerance, ..Rasterizer::new(self.size) };
        let layout = PhiLayout::new(self.softness.clone(), Vec::new(), STEPS, self.size);
        let (phi, faces) = (layout.start(), Some(self.flat.faces.clone()));
        let renderer = ScheduledRenderer::new(layout, &phi, rasterizer, Resolution::Full, faces);
        Renderer { renderer, size: self.size, backend: PhantomData }
    }

    /// Draws by the definition, over all pairs, in f64.
    pub fn dense(&self) -> Drawn {
        let conorm = TConorm::Probabilistic;
        let phi = self.softness.phi_at(1.0, self.size);
        let phi = tensor::<Autodiff<Exact>, 1>(phi.clone(), [phi.len()]);
        let softness = self.softness.softness;
        let scene = reference::Scene { faces: &self.flat.faces, size: self.size.into() };
        drawn::<Exact>(self.flat, self.size, &weights(self.size), |vertices| {
            conorm.coverage(reference::sums(scene, vertices, &softness, conorm, phi))
        })
    }
}

/// Draws faces at any corners.
pub struct Renderer<B: RasterBackend> {
    renderer: ScheduledRenderer,
    size: usize,
    backend: PhantomData<B>,
}

impl<B: RasterBackend> Renderer<B> {
    /// The image of `flat`, and the gradient of the sum of its pixels times `weights`
    /// `[size * size]`.
    pub fn draw(&self, flat: &PlanarScene, weights: &[f64]) -> Drawn {
        drawn::<B>(flat, self.size, weights, |vertices| {
            self.renderer.at(STEPS).silhouette(Projected::new(vertices))
        })
    }
}

fn drawn<B: RasterBackend>(
    flat: &PlanarScene,
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
    pub fn off(&self, other: &Self) -> f64 {
        largest(self.image.iter().zip(&other.image).map(|(a, b)| a - b))
    }

    /// Length of the difference of the gradients over that of the other, or over `least` if that is
    /// longer.
    pub fn gradient_off(&self, other: &Self, least: f64) -> f64 {
        let length = |of: &mut dyn Iterator<Item = f64>| of.map(|x| x * x).sum::<f64>().sqrt();
        let pairs = self.gradient.iter().zip(&other.gradient);
        length(&mut pairs.map(|(a, b)| a - b))
            / length(&mut other.gradient.iter().copied()).max(least)
    }

    /// All numbers.
    pub fn all(&self) -> Vec<f64> {
        self.image.iter().chain(&self.gradient).copied().collect()
    }
}

/// Largest absolute value; NaN if a number is NaN.
pub fn largest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let most =
        |most: f64, x: f64| if most.is_nan() || x.is_nan() { f64::NAN } else { most.max(x.abs()) };
    numbers.into_iter().fold(0.0, most)
}

/// Weights of the pixels, from -1 to 1, that favour no part of the image.
pub fn weights(size: usize) -> Vec<f64> {
    let mut random = Random::new(17);
    (0..size * size).map(|_| random.within(1.0)).collect()
}
