//! Second-order products in f32: as accurate as f32 allows, and more than differences in f32.

use std::sync::Arc;

use softrast_mesh::icosphere;
use softrast_raster::{low_level::Rasterizer, project};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, DType, NdArray, Tensor, TensorData};

type A = Autodiff<NdArray<f32>>;
type AA = Autodiff<A>;

const SIZE: usize = 32;

fn tensor<T: Backend>(values: &[f64], dtype: DType) -> Tensor<T, 1> {
    let data = TensorData::new(values.to_vec(), [values.len()]);
    Tensor::from_data(data, (&Default::default(), dtype))
}

/// Gradient of `Σ w coverage²` with respect to the projected vertices and phi, and gradient of a weighted sum of that with respect to both.
fn products(softness: EdgeSoftness, scale: f64, dtype: DType) -> [Vec<f64>; 4] {
    let mesh = icosphere(2);
    let faces: Arc<[[u32; 3]]> = mesh.faces().into();
    let world = tensor::<NdArray<f32>>(mesh.positions().as_flattened(), dtype);
    let camera = tensor::<NdArray<f32>>(&[2.732, 10.0, 30.0, 60.0], dtype).reshape([1, 4]);
    let projected = project(world.reshape([1, mesh.positions().len() as i64, 3]), camera);
    let inner = Tensor::<A, 3>::from_inner(projected.tensor()).require_grad();
    let inner_phi = tensor::<A>(&softness.default_phi(scale), dtype).require_grad();
    let vertices = Tensor::<AA, 3>::from_inner(inner.clone()).require_grad();
    let phi = Tensor::<AA, 1>::from_inner(inner_phi.clone()).require_grad();
    let silhouette = Rasterizer::new(SIZE).prepare(&faces, softness, &phi);
    let image = silhouette.coverage(vertices.clone(), phi.clone());
    let wave = |count: usize, step: f64| (0..count).map(|k| (step * k as f64).sin()).collect();
    let weights: Vec<f64> = wave(SIZE * SIZE, 0.37);
    let weights = tensor::<AA>(&weights, dtype).reshape([1, SIZE, SIZE]);
    let grads = (image.clone() * image * weights).sum().backward();
    let grad = vertices.grad(&grads).expect("vertices are tracked");
    let grad_phi = phi.grad(&grads).expect("phi is tracked");
    let ramp: Vec<f64> = wave(grad.shape().num_elements(), 0.11);
    let ramp = tensor::<A>(&ramp, dtype).reshape(grad.dims());
    let again = ((grad.clone() * ramp).sum() + grad_phi.clone().sum() * 0.3).backward();
    let second = inner.grad(&again).expect("the gradient depends on the vertices");
    let mixed = inner_phi.grad(&again).expect("the gradient depends on phi");
    let flat = |tensor: Tensor<NdArray<f32>, 3>| tensor.into_data().iter::<f64>().collect();
    let flat1 = |tensor: Tensor<NdArray<f32>, 1>| tensor.into_data().iter::<f64>().collect();
    [flat(grad.inner()), flat1(grad_phi.inner()), flat(second), flat1(mixed)]
}

#[test]
fn second_order_products_in_f32_agree_with_f64() {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    // The kink of a plain distance at the edge has curvature 1 / d, which is sensitive to rounding of d.
    let bounds = [5e-5, 5e-5, 1e-2, 1e-4];
    for family in [Family::Logistic, Family::Gauss, Family::Exp, Family::Mlp] {
        for squared in [false, true] {
            let softness =
                if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
            let scale = if squared { 1e-3 } else { 0.03 };
            let single = products(softness, scale, DType::F32);
            let double = products(softness, scale, DType::F64);
            for (k, (a, b)) in single.iter().zip(&double).enumerate() {
                let off = norm(&mut a.iter().zip(b).map(|(a, b)| a - b));
                let error = off / norm(&mut b.iter().copied());
                assert!(error < bounds[k], "{family}, squared {squared}, quantity {k}: {error:e}");
            }
        }
    }
}
