//! Colours of meshes on the GPU in f32 against the CPU in f64: image, gradients, second order.

use std::sync::Arc;

use softrast_mesh::icosphere;
use softrast_raster::{
    Attributes, Background, ColourRenderer, Projected, RasterBackend, Weighting, project,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, DType, NdArray, Tensor};

use super::{
    adapter,
    products::{numbers, relative, tensor},
};
use crate::{Gpu, triangles::triangles};

/// Largest error of a pixel, and of derivatives relative to their length: larger if tables are computed in f32.
const IMAGE: f64 = 1e-4;
const PRODUCTS: f64 = 2e-3;
const PRODUCTS_OF_TABLES: f64 = 5e-3;

/// A scene to draw.
struct Scene {
    /// `[views, vertices, 3]`: x and y in NDC, depth.
    vertices: Vec<f64>,
    views: usize,
    /// Entries at the corners of faces, and their number.
    entries: (Arc<[[u32; 3]]>, usize),
    /// Number of views with separate attributes, or 1.
    own: usize,
    /// Channels of the image; with a texture, attributes are coordinates on it.
    channels: usize,
    /// Rows and columns of the texture.
    texture: Option<[usize; 2]>,
    renderer: ColourRenderer,
}

/// Inputs with gradients: vertices, attributes, background and texture, or also the parameters of the softnesses.
#[derive(Clone, Copy, PartialEq)]
enum Wanted {
    Scene,
    Softness,
}

/// The image, then gradients of the wanted inputs, then derivatives of a sum of these with respect to the same inputs.
fn products<T: RasterBackend>(scene: &Scene, wanted: Wanted, dtype: DType) -> Vec<Vec<f64>> {
    let Scene { views, channels, own, texture, .. } = *scene;
    let flat =
        |values: &[f64]| tensor::<Autodiff<T>, 1>(values, [values.len()], dtype).require_grad();
    let wave = |count: usize, rate: f64| -> Vec<f64> {
        (0..count).map(|i| 0.5 + 0.4 * (rate * i as f64).sin()).collect()
    };
    let numbers_of_entry = if texture.is_some() { 2 } else { channels };
    let [height, width] = texture.unwrap_or([1, 1]);
    let background =
        scene.renderer.background::<NdArray<f64>>(&vec![0.3; channels], &Default::default());
    let log_weight = numbers(background.log_weight);
    let inner: Vec<_> = [
        scene.vertices.clone(),
        // Some coordinates lie beyond the texture, which repeats.
        wave(own * scene.entries.1 * numbers_of_entry, 0.71)
            .iter()
            .map(|x| 2.0 * x - 0.4)
            .collect(),
        [wave(channels, 1.3), log_weight].concat(),
        wave(height * width * channels, 0.83),
        scene.renderer.phi()[0].clone(),
        scene.renderer.phi()[1].clone(),
    ]
    .iter()
    .map(|values| flat(values))
    .collect();
    let outer: Vec<_> = inner
        .iter()
        .map(|input| Tensor::<Autodiff<_>, 1>::from_inner(input.clone()).require_grad())
        .collect();
    let [vertices, attributes, behind, texels, edge, depth] = &outer[..] else { unreachable!() };
    let shaped = vertices.clone().reshape([views, scene.vertices.len() / 3 / views, 3]);
    let attributes = attributes.clone().reshape([own, scene.entries.1, numbers_of_entry]);
    let mut attributes = Attributes::new(attributes, scene.entries.0.clone());
    if texture.is_some() {
        attributes = attributes.with_texture(texels.clone().reshape([height, width, channels]));
    }
    let background = Background {
        colour: behind.clone().narrow(0, 0, channels),
        log_weight: behind.clone().narrow(0, channels, 1),
    };
    let image = match wanted {
        Wanted::Scene => scene.renderer.image(Projected::new(shaped), &attributes, &background),
        Wanted::Softness => scene.renderer.image_with(
            Projected::new(shaped),
            &attributes,
            [edge, depth],
            &background,
        ),
    };
    let shape = image.dims();
    let weights: Vec<f64> =
        (0..shape.iter().product()).map(|i: usize| (0.37 * i as f64).sin()).collect();
    let grads = (image.clone() * image.clone() * tensor(&weights, shape, dtype)).sum().backward();
    let with_gradient: Vec<usize> = (0..6)
        .filter(|&k| match k {
            3 => texture.is_some(),
            4 | 5 => wanted == Wanted::Softness,
            _ => true,
        })
        .collect();
    let first: Vec<_> =
        with_gradient.iter().map(|&k| outer[k].grad(&grads).expect("a gradient")).collect();
    let sum = first.clone().into_iter().map(|gradient| {
        let length = gradient.dims()[0];
        let ramp: Vec<f64> = (0..length).map(|i| (0.11 * i as f64).cos()).collect();
        (gradient * tensor(&ramp, [length], dtype)).sum()
    });
    let again = sum.reduce(Tensor::add).expect("sums").backward();
    let second =
        with_gradient.iter().map(|&k| numbers(inner[k].grad(&again).expect("second order")));
    [vec![numbers(image)], first.into_iter().map(numbers).collect(), second.collect()].concat()
}

fn assert_close(scene: &Scene, wanted: Wanted, name: &str) {
    let expected = products::<NdArray<f64>>(scene, wanted, DType::F64);
    let found = products::<Gpu>(scene, wanted, DType::F32);
    let image = found[0].iter().zip(&expected[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let errors: Vec<f64> =
        found[1..].iter().zip(&expected[1..]).map(|(a, b)| relative(a, b)).collect();
    let shown: Vec<String> = errors.iter().map(|error| format!("{error:.1e}")).collect();
    println!("{name}: pixels {image:.1e}, products {}", shown.join(", "));
    assert!(image <= IMAGE, "{name}: a pixel is off by {image:e}");
    let most = if wanted == Wanted::Scene { PRODUCTS } else { PRODUCTS_OF_TABLES };
    assert!(errors.iter().all(|&e| e <= most), "{name}: relative errors {shown:?}");
}

fn renderer(
    faces: &Arc<[[u32; 3]]>,
    size: [usize; 2],
    family: Family,
    depth: DepthSoftness,
    planes: [f64; 2],
) -> ColourRenderer {
    let edge = EdgeSoftness::new(family);
    let weighting = Weighting { edge, depth, planes };
    let phi = [edge.default_phi(0.03), depth.default_phi(0.05)];
    ColourRenderer::with_weighting(faces.clone(), size, weighting, phi).with_tolerance(1e-6)
}

/// A ball in three views, with colours at its vertices.
fn ball(family: Family, depth: DepthSoftness) -> Scene {
    ball_of(1, [18, 23], family, depth)
}

/// A ball of 20 faces without `subdivisions`, of 80 after one, on images of this height and width.
fn ball_of(subdivisions: u32, size: [usize; 2], family: Family, depth: DepthSoftness) -> Scene {
    let (ball, azimuths) = (icosphere(subdivisions), [4.1, 108.3, 211.9]);
    let positions = ball.positions();
    let world =
        tensor::<NdArray<f64>, 3>(positions.as_flattened(), [1, positions.len(), 3], DType::F64);
    let orbits: Vec<f64> = azimuths.iter().flat_map(|&a| [2.732, 17.3, a, 60.0]).collect();
    let faces: Arc<[[u32; 3]]> = ball.faces().into();
    Scene {
        vertices: numbers(project(world, tensor(&orbits, [3, 4], DType::F64)).tensor()),
        views: 3,
        entries: (faces.clone(), positions.len()),
        own: 1,
        channels: 3,
        texture: None,
        renderer: renderer(&faces, size, family, depth, [1.7, 3.8]),
    }
}

/// Three intersecting triangles, each with more pixels than a part.
fn large() -> Scene {
    let vertices = vec![
        [-0.83, -0.61, 1.9],
        [0.71, -0.77, 2.6],
        [0.13, 0.87, 2.2],
        [-0.91, 0.52, 2.4],
        [-0.34, -0.95, 1.7],
        [0.88, 0.41, 2.9],
        [0.21, 0.93, 2.1],
        [-0.67, 0.17, 2.3],
        [0.93, -0.38, 2.0],
    ];
    let faces: Arc<[[u32; 3]]> = [[0, 1, 2], [3, 4, 5], [6, 7, 8]].into();
    let depth = DepthSoftness::Family(Family::Exp);
    Scene {
        vertices: vertices.concat(),
        views: 1,
        entries: (faces.clone(), 9),
        own: 1,
        channels: 3,
        texture: None,
        renderer: renderer(&faces, [150, 140], Family::Logistic, depth, [1.7, 3.0]),
    }
}

/// Random triangles at random depths, some outside of the image and some behind the camera, with separate face colours per view.
fn random() -> Scene {
    let (one, faces) = triangles(7, 20);
    let mut vertices = [one.clone(), one].concat();
    for (k, corner) in vertices.chunks_mut(3).enumerate() {
        // Slivers wide enough for f32 to distinguish their edges.
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
        texture: None,
        renderer: renderer(&faces, [18, 23], Family::Logistic, depth, [1.0, 3.0]),
    }
}

#[test]
fn colours_agree_with_the_kernel_in_f64_to_second_order() {
    if !adapter() {
        return;
    }
    let exp = DepthSoftness::Family(Family::Exp);
    let front = ball(Family::Logistic, exp);
    let front = Scene { renderer: front.renderer.clone().without_back_faces(), ..front };
    let scenes = [
        ("a ball", ball(Family::Logistic, exp)),
        ("a ball without back faces", front),
        ("a ball with edges that end", ball(Family::Uniform, exp)),
        ("a ball by the network of depths", ball(Family::Gauss, DepthSoftness::Mlp)),
        ("random triangles", random()),
        // Faces with more pixels than a part.
        ("faces in parts", large()),
        ("faces in parts in a picture", Scene { texture: Some([5, 7]), ..large() }),
        ("a ball in a picture", Scene { texture: Some([5, 7]), ..ball(Family::Logistic, exp) }),
        ("a ball in two texels", Scene { texture: Some([1, 2]), ..ball(Family::Logistic, exp) }),
        ("random triangles in pictures", Scene { texture: Some([3, 4]), channels: 4, ..random() }),
    ];
    for (name, scene) in scenes {
        assert_close(&scene, Wanted::Scene, name);
    }
}

#[test]
fn gradients_of_large_faces_that_share_edges_agree_with_the_kernel_in_f64() {
    if !adapter() {
        return;
    }
    // Some pixels are so near an edge that squared distances do not determine the nearest one. The second order is not checked: f32 on the
    // CPU has errors there too.
    let scene = ball_of(0, [150, 140], Family::Logistic, DepthSoftness::Family(Family::Exp));
    let expected = products::<NdArray<f64>>(&scene, Wanted::Scene, DType::F64);
    let found = products::<Gpu>(&scene, Wanted::Scene, DType::F32);
    let errors: Vec<f64> = (1..4).map(|k| relative(&found[k], &expected[k])).collect();
    println!("{errors:?}");
    assert!(errors.iter().all(|&error| error <= 2e-4), "relative errors {errors:?}");
}

#[test]
fn gradients_to_the_softnesses_agree_with_the_kernel_in_f64() {
    if !adapter() {
        return;
    }
    // At .03 a pixel lies on the end of an edge, where rounding determines the second order, on the CPU too.
    let mut edges_that_end = ball(Family::Uniform, DepthSoftness::Family(Family::Exp));
    let [_, depth] = edges_that_end.renderer.phi().clone();
    edges_that_end.renderer.set_phi([vec![0.025_f64.ln()], depth]);
    let scenes = [
        ("an exponential", ball(Family::Logistic, DepthSoftness::Family(Family::Exp))),
        ("edges that end", edges_that_end),
        ("a line", ball(Family::Logistic, DepthSoftness::Mlp)),
        ("a table", ball(Family::Gauss, DepthSoftness::Family(Family::Logistic))),
        ("random triangles in pictures", Scene { texture: Some([3, 4]), channels: 3, ..random() }),
    ];
    for (name, scene) in scenes {
        assert_close(&scene, Wanted::Softness, name);
    }
}

#[test]
fn colours_textures_and_softnesses_get_the_same_gradients_every_time() {
    if !adapter() {
        return;
    }
    let exp = DepthSoftness::Family(Family::Exp);
    let textured = Scene { texture: Some([2, 2]), ..ball(Family::Logistic, exp) };
    let cut = large();
    for (scene, wanted) in [(&textured, Wanted::Scene), (&cut, Wanted::Softness)] {
        let [first, second] = [(); 2].map(|()| products::<Gpu>(scene, wanted, DType::F32));
        assert_eq!(first, second);
    }
}

#[test]
fn views_that_no_launch_takes_together_are_drawn_in_parts() {
    if !adapter() {
        return;
    }
    // The last views differ from those of any earlier batch.
    let views = 65_540;
    let triangle = |view: usize| {
        let shift = if view < 65_530 { 0.0 } else { 0.01 * (view - 65_530) as f64 };
        [[-0.5, -0.4], [0.5, -0.6], [0.1, 0.5]].map(|[x, y]| [x + shift, y + shift, 2.0])
    };
    let renderer = ColourRenderer::new(&[[0, 1, 2]], 1, Family::Logistic, 0.1, [1.0, 3.0]);
    let image = |first: usize, count: usize| -> Vec<f64> {
        let part: Vec<f64> = (first..first + count).flat_map(triangle).flatten().collect();
        let colours = tensor::<Gpu, 3>(&[0.2, 0.5, 0.9], [1, 3, 1], DType::F32);
        let attributes = Attributes::of_vertices(colours, &[[0, 1, 2]]);
        let background = renderer.background(&[0.0], &Default::default());
        let vertices = tensor::<Gpu, 3>(&part, [count, 3, 3], DType::F32);
        numbers(renderer.image(Projected::new(vertices), &attributes, &background))
    };
    assert_eq!(image(0, views)[2 * 65_520..], image(65_520, 20));
}

#[test]
fn an_upstream_that_is_no_number_gives_a_texture_none() {
    if !adapter() {
        return;
    }
    let exp = DepthSoftness::Family(Family::Exp);
    let scene = ball(Family::Logistic, exp);
    let tensor = |values: &[f64], shape| tensor::<Autodiff<Gpu>, 3>(values, shape, DType::F32);
    let texture = tensor(&[0.5; 12], [2, 2, 3]).require_grad();
    let places: Vec<f64> = (0..2 * scene.entries.1).map(|k| 0.07 * k as f64).collect();
    let attributes = Attributes::new(tensor(&places, [1, scene.entries.1, 2]), scene.entries.0)
        .with_texture(texture.clone());
    let vertices = tensor(&scene.vertices, [3, scene.vertices.len() / 9, 3]);
    let background = scene.renderer.background(&[0.3; 3], &vertices.device());
    let image = scene.renderer.image(Projected::new(vertices), &attributes, &background);
    // One pixel in the middle of the ball.
    let [_, _, height, width] = image.dims();
    let one = image.narrow(2, height / 2, 1).narrow(3, width / 2, 1);
    let gradient = texture.grad(&(one * f64::NAN).sum().backward()).expect("a gradient");
    assert!(numbers(gradient).iter().any(|x| x.is_nan()), "a broken loss looks like a flat one");
}
