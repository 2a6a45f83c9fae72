//! Colours of meshes on the GPU in f32 against the CPU in f64: image, gradients, second order.

use std::sync::Arc;

use burn::{
    backend::{Autodiff, NdArray},
    tensor::{DType, Tensor},
};
use softrast_mesh::icosphere;
use softrast_raster::{
    Attributes, Background, ColourRenderer, RasterBackend, Weighting, Wgpu, project,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};

use crate::{
    adapter,
    products::{numbers, relative, tensor},
    triangles::triangles,
};

/// Largest error of a pixel, and of derivatives relative to their length.
const IMAGE: f64 = 1e-4;
const PRODUCTS: f64 = 2e-3;

/// What is drawn.
struct Scene {
    /// `[views, vertices, 3]`: x and y in NDC, depth.
    vertices: Vec<f64>,
    views: usize,
    /// At the corners of faces, and how many there are.
    entries: (Arc<[[u32; 3]]>, usize),
    /// Views that have attributes of their own.
    own: usize,
    channels: usize,
    renderer: ColourRenderer,
}

/// The image, then gradients to vertices, attributes and background, then derivatives of a sum of these to the same.
fn products<T: RasterBackend>(scene: &Scene, dtype: DType) -> Vec<Vec<f64>> {
    let Scene { views, channels, own, .. } = *scene;
    let flat =
        |values: &[f64]| tensor::<Autodiff<T>, 1>(values, [values.len()], dtype).require_grad();
    let wave = |count: usize, rate: f64| -> Vec<f64> {
        (0..count).map(|i| 0.5 + 0.4 * (rate * i as f64).sin()).collect()
    };
    let count = own * scene.entries.1 * channels;
    let background =
        scene.renderer.background::<NdArray<f64>>(&vec![0.3; channels], &Default::default());
    let log_weight = numbers(background.log_weight);
    let inner = [
        flat(&scene.vertices),
        flat(&wave(count, 0.71)),
        flat(&[wave(channels, 1.3), log_weight].concat()),
    ];
    let outer =
        inner.clone().map(|input| Tensor::<Autodiff<_>, 1>::from_inner(input).require_grad());
    let [vertices, attributes, behind] = outer.clone();
    let shaped = vertices.reshape([views, scene.vertices.len() / 3 / views, 3]);
    let attributes = attributes.reshape([own, scene.entries.1, channels]);
    let attributes = Attributes::new(attributes, scene.entries.0.clone());
    let background = Background {
        colour: behind.clone().narrow(0, 0, channels),
        log_weight: behind.narrow(0, channels, 1),
    };
    let image = scene.renderer.image(shaped, &attributes, &background);
    let shape = image.dims();
    let weights: Vec<f64> =
        (0..shape.iter().product()).map(|i: usize| (0.37 * i as f64).sin()).collect();
    let grads = (image.clone() * image.clone() * tensor(&weights, shape, dtype)).sum().backward();
    let first = outer.each_ref().map(|input| input.grad(&grads).expect("a gradient"));
    let sum = first.clone().map(|gradient| {
        let length = gradient.dims()[0];
        let ramp: Vec<f64> = (0..length).map(|i| (0.11 * i as f64).cos()).collect();
        (gradient * tensor(&ramp, [length], dtype)).sum()
    });
    let again = sum.into_iter().reduce(Tensor::add).expect("three sums").backward();
    let second = inner.each_ref().map(|input| numbers(input.grad(&again).expect("second order")));
    [vec![numbers(image)], first.map(numbers).into(), second.into()].concat()
}

fn assert_close(scene: &Scene, name: &str) {
    let expected = products::<NdArray<f64>>(scene, DType::F64);
    let found = products::<Wgpu>(scene, DType::F32);
    let image = found[0].iter().zip(&expected[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let errors: Vec<f64> =
        found[1..].iter().zip(&expected[1..]).map(|(a, b)| relative(a, b)).collect();
    let shown: Vec<String> = errors.iter().map(|error| format!("{error:.1e}")).collect();
    println!("{name}: pixels {image:.1e}, products {}", shown.join(", "));
    assert!(image <= IMAGE, "{name}: a pixel is off by {image:e}");
    assert!(errors.iter().all(|&e| e <= PRODUCTS), "{name}: relative errors {shown:?}");
}

fn renderer(
    faces: &Arc<[[u32; 3]]>,
    family: Family,
    depth: DepthSoftness,
    planes: [f64; 2],
) -> ColourRenderer {
    let edge = EdgeSoftness { family, squared: false };
    let weighting = Weighting { edge, depth, planes };
    let phi = [edge.default_phi(0.03), depth.default_phi(0.05)];
    ColourRenderer::with_weighting(faces.clone(), [18, 23], weighting, phi).with_tolerance(1e-6)
}

/// A ball from three sides, its colours at its vertices.
fn ball(family: Family, depth: DepthSoftness) -> Scene {
    let (ball, azimuths) = (icosphere(1), [4.1, 108.3, 211.9]);
    let positions = ball.positions();
    let world =
        tensor::<NdArray<f64>, 3>(positions.as_flattened(), [1, positions.len(), 3], DType::F64);
    let orbits: Vec<f64> = azimuths.iter().flat_map(|&a| [2.732, 17.3, a, 60.0]).collect();
    let faces: Arc<[[u32; 3]]> = ball.faces().into();
    Scene {
        vertices: numbers(project(world, tensor(&orbits, [3, 4], DType::F64))),
        views: 3,
        entries: (faces.clone(), positions.len()),
        own: 1,
        channels: 3,
        renderer: renderer(&faces, family, depth, [1.7, 3.8]),
    }
}

/// Random triangles at random depths, some beside the image and some behind the camera, each view with colours of its own for each face.
fn random() -> Scene {
    let (one, faces) = triangles(7, 20);
    let mut vertices = [one.clone(), one].concat();
    for (k, corner) in vertices.chunks_mut(3).enumerate() {
        // Slivers as wide as f32 can tell their edges apart.
        if k % 15 == 14 {
            corner[0] += 0.03;
            corner[1] -= 0.02;
        }
        corner[2] *= 1.0 + 0.4 * (1.9 * k as f64).sin();
    }
    let count = faces.len();
    let entries = (0..count as u32).map(|face| [face; 3]).collect();
    let depth = DepthSoftness::Family(Family::Logistic);
    Scene {
        vertices,
        views: 2,
        entries: (entries, count),
        own: 2,
        channels: 5,
        renderer: renderer(&faces, Family::Logistic, depth, [1.0, 3.0]),
    }
}

#[test]
fn colours_agree_with_the_kernel_in_f64_to_second_order() {
    if !adapter() {
        return;
    }
    let exp = DepthSoftness::Family(Family::Exp);
    assert_close(&ball(Family::Logistic, exp), "a ball");
    assert_close(&ball(Family::Uniform, exp), "a ball with edges that end");
    assert_close(&ball(Family::Gauss, DepthSoftness::Mlp), "a ball by the network of depths");
    assert_close(&random(), "random triangles");
}
