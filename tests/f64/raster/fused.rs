//! The fused op compared with the reference, in f64: image, gradient, second order.

use std::sync::Arc;

use softrast_raster::{RasterBackend, TConorm, low_level::Rasterizer, reference};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::vector;

use super::triangles::triangles;

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

const SIZE: usize = 8;

fn fused<T: RasterBackend>(
    faces: &Arc<[[u32; 3]]>,
    softness: EdgeSoftness,
    t_conorm: TConorm,
    vertices: Tensor<T, 3>,
    phi: Tensor<T, 1>,
) -> Tensor<T, 3> {
    let rasterizer = Rasterizer { tolerance: 1e-9, t_conorm, ..Rasterizer::new(SIZE) };
    rasterizer.prepare(faces, softness, &phi).coverage(vertices, phi)
}

fn dense<T: Backend>(
    faces: &Arc<[[u32; 3]]>,
    softness: EdgeSoftness,
    t_conorm: TConorm,
    vertices: Tensor<T, 3>,
    phi: Tensor<T, 1>,
) -> Tensor<T, 3> {
    let scene = reference::Scene { faces, size: SIZE.into() };
    t_conorm.coverage(reference::sums(scene, vertices, &softness, t_conorm, phi))
}

fn relative(a: &Tensor<B, 1>, b: &Tensor<B, 1>) -> f64 {
    let norm = |t: Tensor<B, 1>| (t.clone() * t).sum().into_scalar().sqrt();
    norm(a.clone() - b.clone()) / norm(b.clone()).max(1e-12)
}

/// Largest errors of the image, the gradients with respect to vertices and phi, and the second-order products.
fn compare(softness: EdgeSoftness, t_conorm: TConorm, scale: f64) -> [f64; 5] {
    let (values, faces) = triangles(7, 20);
    let count = values.len() / 3;
    let phi_values = softness.default_phi(scale);
    let weights: Vec<f64> = (0..SIZE * SIZE).map(|i| (0.37 * i as f64).sin()).collect();
    let run = |path: bool| {
        let inner_vertices = vector::<A>(&values).require_grad();
        let inner_phi = vector::<A>(&phi_values).require_grad();
        let vertices = Tensor::<AA, 1>::from_inner(inner_vertices.clone()).require_grad();
        let phi = Tensor::<AA, 1>::from_inner(inner_phi.clone()).require_grad();
        let shaped = vertices.clone().reshape([1, count, 3]);
        let image = if path {
            fused(&faces, softness, t_conorm, shaped, phi.clone())
        } else {
            dense(&faces, softness, t_conorm, shaped, phi.clone())
        };
        let weights = vector::<AA>(&weights).reshape([1, SIZE, SIZE]);
        let plain = image.clone().inner().inner().reshape([SIZE * SIZE]);
        let loss = (image.clone() * image * weights).sum();
        let grads = loss.backward();
        let grad = vertices.grad(&grads).expect("a gradient to the vertices");
        let grad_phi = phi.grad(&grads).expect("a gradient to phi");
        // Second order: a weighted sum of both gradients, differentiated again.
        let ramp: Vec<f64> = (0..values.len()).map(|i| (0.11 * i as f64).cos()).collect();
        let sum = (grad.clone() * vector::<A>(&ramp)).sum() + grad_phi.clone().sum() * 0.3;
        let again = sum.backward();
        let second = inner_vertices.grad(&again).expect("second order to the vertices");
        let mixed = inner_phi.grad(&again).expect("second order to phi");
        [plain, grad.inner(), grad_phi.inner(), second, mixed]
    };
    let (a, b) = (run(true), run(false));
    let mut errors = [0.0; 5];
    for (k, (a, b)) in a.iter().zip(&b).enumerate() {
        errors[k] = relative(a, b);
    }
    errors
}

fn assert_close(name: &str, errors: [f64; 5]) {
    // A cubic Hermite table has a continuous slope; its curvature is accurate to second order.
    let bounds = [1e-8, 1e-6, 2e-6, 1e-4, 2e-6];
    for (k, (error, bound)) in errors.into_iter().zip(bounds).enumerate() {
        assert!(error <= bound, "{name}, quantity {k}: relative error {error:e} above {bound:e}");
    }
}

#[test]
fn every_t_conorm_agrees_with_the_reference_to_second_order() {
    let conorms = [
        TConorm::Probabilistic,
        TConorm::Einstein,
        TConorm::Hamacher(0.5),
        TConorm::Frank(2.0),
        TConorm::Yager(2.0),
        TConorm::AczelAlsina(2.0),
        TConorm::Dombi(1.5),
        TConorm::SchweizerSklar(-1.0),
    ];
    for conorm in conorms {
        let softness = EdgeSoftness::new(Family::Logistic);
        assert_close(&conorm.to_string(), compare(softness, conorm, 0.05));
    }
}

#[test]
fn every_family_agrees_with_the_reference_to_second_order() {
    for family in Family::ALL {
        for squared in [false, true] {
            let softness =
                if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
            let scale = if squared { 0.01 } else { 0.05 };
            let errors = compare(softness, TConorm::Probabilistic, scale);
            assert_close(&format!("{family}, squared {squared}"), errors);
        }
    }
}
