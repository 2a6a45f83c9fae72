//! All results for a scene, on any backend and with either implementation.

use std::sync::Arc;

use softrast_raster::{ImageSize, RasterBackend, TConorm, low_level::Rasterizer, reference};
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tensor::{Autodiff, Backend, DType, NdArray, Tensor, TensorData};

/// A scene and its softness.
pub(crate) struct Scene {
    /// `[views, vertices, 3]`: x and y in NDC, depth.
    pub(crate) vertices: Vec<f64>,
    pub(crate) views: usize,
    pub(crate) faces: Arc<[[u32; 3]]>,
    pub(crate) size: ImageSize,
    pub(crate) softness: EdgeSoftness,
    /// Scale of the softness.
    pub(crate) scale: f64,
}

/// The implementation, and its inputs in addition to the vertices.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Path {
    /// The fused op, with the parameters of the softness.
    Fused,
    /// The fused op, with a table computed in f64.
    Table,
    /// Tensor ops over every pixel and face, with the parameters of the softness.
    Reference,
}

/// Coverage, and the derivatives of weighted sums of its squares.
#[derive(Debug, PartialEq)]
pub(crate) struct Products {
    pub(crate) image: Vec<f64>,
    /// Gradients with respect to the vertices and the other input, then the derivatives of a sum of both with respect to the other input
    /// and, with a table, to the vertices: the curvature of a table computed in f32 is dominated by rounding where its cells are narrow.
    /// For a table, only the derivative along a change of scale is compared: rounding determines which of two cells gets a pair between
    /// them.
    pub(crate) products: Vec<Vec<f64>>,
}

/// Largest error of a pixel.
const IMAGE: f64 = 1e-5;
/// Largest error of a gradient or of a product of second order, relative to its length.
const PRODUCTS: f64 = 1e-3;

pub(crate) fn tensor<T: Backend, const D: usize>(
    values: &[f64],
    shape: [usize; D],
    dtype: DType,
) -> Tensor<T, D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), (&Default::default(), dtype))
}

pub(crate) fn numbers<T: Backend, const D: usize>(tensor: Tensor<T, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

impl Products {
    pub(crate) fn new<T: RasterBackend>(scene: &Scene, dtype: DType, path: Path) -> Self {
        let Scene { views, size, softness, .. } = *scene;
        let count = scene.vertices.len() / 3 / views;
        let phi = softness.default_phi(scene.scale);
        // Far below the default, and the same on every backend.
        let rasterizer = Rasterizer { tolerance: 1e-7, ..Rasterizer::new(size) };
        let exact = |phi: &[f64]| tensor::<NdArray<f64>, 1>(phi, [phi.len()], DType::F64);
        let silhouette = rasterizer.prepare(&scene.faces, softness, &exact(&phi));
        let of_scale = |scale: f64| numbers(silhouette.table(exact(&softness.default_phi(scale))));
        let [table, wider] = [1.0, 1.01].map(|factor| of_scale(factor * scene.scale));
        let (other_values, along) = match path {
            Path::Table => (&table, wider.iter().zip(&table).map(|(b, a)| b - a).collect()),
            _ => (&phi, vec![1.0; phi.len()]),
        };
        let flat =
            |values: &[f64]| tensor::<Autodiff<T>, 1>(values, [values.len()], dtype).require_grad();
        let inner_vertices = flat(&scene.vertices);
        let inner_other = flat(other_values);
        let vertices = Tensor::<Autodiff<_>, 1>::from_inner(inner_vertices.clone()).require_grad();
        let other = Tensor::<Autodiff<_>, 1>::from_inner(inner_other.clone()).require_grad();
        let shaped = vertices.clone().reshape([views, count, 3]);
        let image = match path {
            Path::Fused => silhouette.coverage(shaped, other.clone()),
            Path::Table => {
                let table = other.clone().reshape([table.len() / 4, 4]);
                silhouette.coverage_by_table(shaped, table)
            }
            Path::Reference => {
                let t_conorm = TConorm::Probabilistic;
                let drawn = reference::Scene { faces: &scene.faces, size };
                let sums = reference::sums(drawn, shaped, &softness, t_conorm, other.clone());
                t_conorm.coverage(sums)
            }
        };
        let weights: Vec<f64> =
            (0..views * size.pixels()).map(|i| (0.37 * i as f64).sin()).collect();
        let weights = tensor(&weights, [views, size.height, size.width], dtype);
        let plain = numbers(image.clone());
        let grads = (image.clone() * image * weights).sum().backward();
        let to_vertices = vertices.grad(&grads).expect("a gradient to the vertices");
        let to_other = other.grad(&grads).expect("a gradient to the other input");
        let ramp: Vec<f64> = (0..scene.vertices.len()).map(|i| (0.11 * i as f64).cos()).collect();
        let ramp = tensor(&ramp, [ramp.len()], dtype);
        let weights = tensor(&along, [along.len()], dtype);
        let sum = (to_vertices.clone() * ramp).sum() + (to_other.clone() * weights).sum();
        let again = sum.backward();
        let second = inner_vertices.grad(&again).expect("second order to the vertices");
        let mixed = inner_other.grad(&again).expect("second order to the other input");
        let mut products = vec![numbers(to_vertices), numbers(to_other), numbers(mixed)];
        if path == Path::Table {
            for product in &mut products[1..] {
                *product = vec![product.iter().zip(&along).map(|(g, x)| g * x).sum()];
            }
        }
        if path == Path::Table {
            products.push(numbers(second));
        }
        Self { image: plain, products }
    }

    /// Compares `self` with the results in f64.
    pub(crate) fn assert_close(&self, expected: &Self, name: &str) {
        let image = self.image.iter().zip(&expected.image).map(|(a, b)| (a - b).abs());
        let image = image.fold(0.0, f64::max);
        let errors = self.products.iter().zip(&expected.products).map(|(a, b)| relative(a, b));
        let errors: Vec<f64> = errors.collect();
        let shown: Vec<String> = errors.iter().map(|error| format!("{error:.1e}")).collect();
        println!("{name}: pixels {image:.1e}, products {}", shown.join(", "));
        assert!(image <= IMAGE, "{name}: a pixel is off by {image:e}");
        assert!(errors.iter().all(|&e| e <= PRODUCTS), "{name}: relative errors {shown:?}");
    }
}

/// Distance of two vectors relative to the length of the second; infinite if it is not a number.
pub(crate) fn relative(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let error = norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied());
    if error.is_nan() { f64::INFINITY } else { error }
}
