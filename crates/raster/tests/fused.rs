//! The fused op against the reference, in f64: image, gradient, second order.

use std::sync::Arc;

use burn::{
    backend::{Autodiff, NdArray},
    tensor::{Tensor, TensorData, Tolerance},
};
use softrast_raster::{RasterBackend, Rasterizer, TConorm, reference};
use softrast_softness::{EdgeSoftness, Family, Softness};

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

const SIZE: usize = 12;

/// A scene of random triangles, some of them degenerate, off screen or behind the camera.
fn triangles(seed: u64, count: usize) -> (Vec<f64>, Arc<[[u32; 3]]>) {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut vertices = Vec::new();
    for face in 0..count {
        let centre = [2.4 * random() - 1.2, 2.4 * random() - 1.2];
        let radius = 0.1 + 0.5 * random();
        for corner in 0..3 {
            let angle = std::f64::consts::TAU * (f64::from(corner) / 3.0 + 0.2 * random());
            vertices.extend([
                centre[0] + radius * angle.cos(),
                centre[1] + radius * angle.sin(),
                if face % 7 == 3 { -1.0 } else { 2.0 },
            ]);
        }
        if face % 5 == 4 {
            // A sliver: the third corner almost on the first edge.
            let at = vertices.len() - 9;
            for axis in 0..2 {
                vertices[at + 6 + axis] =
                    0.3 * vertices[at + axis] + 0.7 * vertices[at + 3 + axis] + 1e-9;
            }
        }
    }
    let faces = (0..count as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    (vertices, faces)
}

fn tensor<T: burn::tensor::backend::Backend>(values: &[f64]) -> Tensor<T, 1> {
    let data = TensorData::new(values.to_vec(), [values.len()]);
    Tensor::from_data(data, (&Default::default(), burn::tensor::DType::F64))
}

fn fused<T: RasterBackend>(
    faces: &Arc<[[u32; 3]]>,
    softness: EdgeSoftness,
    t_conorm: TConorm,
    vertices: Tensor<T, 3>,
    phi: Tensor<T, 1>,
) -> Tensor<T, 3> {
    let rasterizer = Rasterizer { size: SIZE, tolerance: 1e-9, t_conorm };
    rasterizer.prepare(faces, softness, &phi).coverage(vertices, phi)
}

fn dense<T: burn::tensor::backend::Backend>(
    faces: &Arc<[[u32; 3]]>,
    softness: EdgeSoftness,
    t_conorm: TConorm,
    vertices: Tensor<T, 3>,
    phi: Tensor<T, 1>,
) -> Tensor<T, 3> {
    let scene = reference::Scene { faces, size: SIZE };
    t_conorm.coverage(reference::sums(scene, vertices, &softness, t_conorm, phi))
}

fn relative(a: &Tensor<B, 1>, b: &Tensor<B, 1>) -> f64 {
    let norm = |t: Tensor<B, 1>| (t.clone() * t).sum().into_scalar().sqrt();
    norm(a.clone() - b.clone()) / norm(b.clone()).max(1e-12)
}

/// Image, gradients to vertices and phi, and the second-order products of both paths.
fn compare(softness: EdgeSoftness, t_conorm: TConorm, scale: f64) -> [f64; 5] {
    let (values, faces) = triangles(7, 20);
    let count = values.len() / 3;
    let phi_values = softness.with_scale(scale);
    let weights: Vec<f64> = (0..SIZE * SIZE).map(|i| (0.37 * i as f64).sin()).collect();
    let run = |path: bool| {
        let vertices: Tensor<AA, 1> = Tensor::from_inner(Tensor::from_inner(tensor::<B>(&values)));
        let inner_vertices = tensor::<A>(&values).require_grad();
        let inner_phi = tensor::<A>(&phi_values).require_grad();
        drop(vertices);
        let vertices = Tensor::<AA, 1>::from_inner(inner_vertices.clone()).require_grad();
        let phi = Tensor::<AA, 1>::from_inner(inner_phi.clone()).require_grad();
        let shaped = vertices.clone().reshape([1, count, 3]);
        let image = if path {
            fused(&faces, softness, t_conorm, shaped, phi.clone())
        } else {
            dense(&faces, softness, t_conorm, shaped, phi.clone())
        };
        let weights = tensor::<AA>(&weights).reshape([1, SIZE, SIZE]);
        let plain = image.clone().inner().inner().reshape([SIZE * SIZE]);
        let loss = (image.clone() * image * weights).sum();
        let grads = loss.backward();
        let grad = vertices.grad(&grads).expect("a gradient to the vertices");
        let grad_phi = phi.grad(&grads).expect("a gradient to phi");
        // Second order: a weighted sum of both gradients, differentiated again.
        let ramp: Vec<f64> = (0..values.len()).map(|i| (0.11 * i as f64).cos()).collect();
        let sum = (grad.clone() * tensor::<A>(&ramp)).sum() + grad_phi.clone().sum() * 0.3;
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

#[test]
fn fused_agrees_with_reference_to_second_order() {
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
        let softness = EdgeSoftness { family: Family::Logistic, squared: false };
        println!("{conorm} {:?}", compare(softness, conorm, 0.05));
    }
    for family in Family::ALL {
        for squared in [false, true] {
            let softness = EdgeSoftness { family, squared };
            let scale = if squared { 0.01 } else { 0.05 };
            println!("{family} {squared} {:?}", compare(softness, TConorm::Probabilistic, scale));
        }
    }
    let _ = Tolerance::<f64>::default();
}
