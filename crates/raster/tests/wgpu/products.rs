//! Everything that can be computed of a scene, on any backend and by either path.

use std::sync::Arc;

use burn::{
    backend::{Autodiff, NdArray},
    tensor::{DType, Tensor, TensorData, backend::Backend},
};
use softrast_raster::{RasterBackend, Rasterizer, TConorm, reference};
use softrast_softness::EdgeSoftness;

/// What is drawn, and how softly.
pub(crate) struct Scene {
    /// `[views, vertices, 3]`: x and y in NDC, depth.
    pub(crate) vertices: Vec<f64>,
    pub(crate) views: usize,
    pub(crate) faces: Arc<[[u32; 3]]>,
    pub(crate) size: usize,
    pub(crate) softness: EdgeSoftness,
    pub(crate) scale: f64,
}

/// Who draws it.
#[derive(Clone, Copy)]
pub(crate) enum Path {
    /// The fused op of the backend.
    Fused,
    /// Tensor ops over every pixel and face.
    Reference,
}

/// Coverage, the gradients of a weighted sum of its squares, and those of a weighted sum of them.
#[derive(Debug, PartialEq)]
pub(crate) struct Products {
    pub(crate) image: Vec<f64>,
    pub(crate) gradient: Vec<f64>,
    pub(crate) gradient_phi: Vec<f64>,
    pub(crate) second: Vec<f64>,
    pub(crate) mixed: Vec<f64>,
}

/// How far products may be apart.
pub(crate) struct Bounds {
    /// Of any pixel, absolute.
    pub(crate) image: f64,
    /// Of the gradients and second-order products, relative to their length.
    pub(crate) products: f64,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { image: 1e-5, products: 1e-3 }
    }
}

pub(crate) fn tensor<T: Backend, const D: usize>(
    values: &[f64],
    shape: [usize; D],
    dtype: DType,
) -> Tensor<T, D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), (&Default::default(), dtype))
}

fn numbers<T: Backend, const D: usize>(tensor: Tensor<T, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

impl Products {
    pub(crate) fn new<T: RasterBackend>(scene: &Scene, dtype: DType, path: Path) -> Self {
        let Scene { views, size, softness, .. } = *scene;
        let count = scene.vertices.len() / 3 / views;
        let phi_values = softness.default_phi(scene.scale);
        let flat = |values: &[f64]| {
            tensor::<Autodiff<T>, 1>(values, [values.len()], dtype).require_grad()
        };
        let (inner_vertices, inner_phi) = (flat(&scene.vertices), flat(&phi_values));
        let vertices = Tensor::<Autodiff<_>, 1>::from_inner(inner_vertices.clone()).require_grad();
        let phi = Tensor::<Autodiff<_>, 1>::from_inner(inner_phi.clone()).require_grad();
        let shaped = vertices.clone().reshape([views, count, 3]);
        let image = match path {
            Path::Fused => {
                // Far below what is asked for, and the same on every backend.
                let rasterizer = Rasterizer { tolerance: 1e-7, ..Rasterizer::new(size) };
                let exact = tensor::<NdArray<f64>, 1>(&phi_values, [phi_values.len()], DType::F64);
                rasterizer.prepare(&scene.faces, softness, &exact).coverage(shaped, phi.clone())
            }
            Path::Reference => {
                let t_conorm = TConorm::Probabilistic;
                let drawn = reference::Scene { faces: &scene.faces, size };
                let sums = reference::sums(drawn, shaped, &softness, t_conorm, phi.clone());
                t_conorm.coverage(sums)
            }
        };
        let weights: Vec<f64> = (0..views * size * size).map(|i| (0.37 * i as f64).sin()).collect();
        let weights = tensor(&weights, [views, size, size], dtype);
        let plain = numbers(image.clone());
        let grads = (image.clone() * image * weights).sum().backward();
        let gradient = vertices.grad(&grads).expect("a gradient to the vertices");
        let gradient_phi = phi.grad(&grads).expect("a gradient to phi");
        let ramp: Vec<f64> = (0..scene.vertices.len()).map(|i| (0.11 * i as f64).cos()).collect();
        let ramp = tensor(&ramp, [ramp.len()], dtype);
        let sum = (gradient.clone() * ramp).sum() + gradient_phi.clone().sum() * 0.3;
        let again = sum.backward();
        let second = inner_vertices.grad(&again).expect("second order to the vertices");
        let mixed = inner_phi.grad(&again).expect("second order to phi");
        Self {
            image: plain,
            gradient: numbers(gradient),
            gradient_phi: numbers(gradient_phi),
            second: numbers(second),
            mixed: numbers(mixed),
        }
    }

    pub(crate) fn assert_close(&self, expected: &Self, name: &str, bounds: Bounds) {
        let image = self.image.iter().zip(&expected.image).map(|(a, b)| (a - b).abs());
        let image = image.fold(0.0, f64::max);
        let products = [
            (&self.gradient, &expected.gradient),
            (&self.gradient_phi, &expected.gradient_phi),
            (&self.second, &expected.second),
            (&self.mixed, &expected.mixed),
        ];
        let products = products.map(|(a, b)| relative(a, b));
        let shown = products.map(|error| format!("{error:.1e}")).join(", ");
        println!("{name}: image {image:.1e}, products {shown}");
        assert!(image <= bounds.image, "{name}: a pixel is off by {image:e}");
        let worst = products.into_iter().fold(0.0, f64::max);
        assert!(worst <= bounds.products, "{name}: relative errors {shown}");
    }
}

/// Distance of two vectors relative to the length of the second; infinite if it is not a number.
fn relative(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let error = norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied());
    if error.is_nan() { f64::INFINITY } else { error }
}
