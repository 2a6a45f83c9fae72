//! The fused op on the GPU in f32 against f64 on the CPU: image, gradient, second order.

mod colours;
mod launches;
mod products;
mod small_ops;
mod workloads;

use std::sync::Arc;

use products::{Path, Products, Scene, tensor};
use softrast_mesh::{Mesh, fox, icosphere};
use softrast_raster::{ImageSize, RasterBackend, TConorm, low_level::Rasterizer, project};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{DType, NdArray, Tensor};

use crate::{Gpu, device_name, triangles};

/// Prints the adapter or card that the test runs on, or `skipped`.
fn adapter() -> bool {
    match device_name() {
        Ok(name) => println!("on {name}"),
        Err(none) => println!("skipped: {none}"),
    }
    device_name().is_ok()
}

/// A mesh from a distance of 2.732, for an elevation and some azimuths in degrees.
fn seen(
    mesh: &Mesh,
    (elevation, azimuths): (f64, &[f64]),
    size: impl Into<ImageSize>,
    softness: EdgeSoftness,
    scale: f64,
) -> Scene {
    let positions = mesh.positions();
    let world: Tensor<NdArray<f64>, 3> =
        tensor(positions.as_flattened(), [1, positions.len(), 3], DType::F64);
    let orbits: Vec<f64> = azimuths.iter().flat_map(|&a| [2.732, elevation, a, 60.0]).collect();
    let orbits: Tensor<NdArray<f64>, 2> = tensor(&orbits, [azimuths.len(), 4], DType::F64);
    Scene {
        vertices: project(world, orbits).tensor().into_data().iter().collect(),
        views: azimuths.len(),
        faces: mesh.faces().into(),
        size: size.into(),
        softness,
        scale,
    }
}

/// Random triangles, with slivers, and faces outside of the image and behind the camera.
fn random(softness: EdgeSoftness, scale: f64) -> Scene {
    let (mut vertices, faces) = triangles::triangles(7, 20);
    // Far outside of the image.
    for corner in 0..3 {
        vertices[3 * corner] += 40.0;
    }
    // Slivers wide enough for f32 to determine the nearer edge.
    for sliver in vertices.chunks_mut(9).skip(4).step_by(5) {
        sliver[6] += 0.03;
        sliver[7] -= 0.02;
    }
    Scene { vertices, views: 1, faces, size: 12.into(), softness, scale }
}

#[test]
fn a_straight_edge_is_the_softness_itself() {
    if !adapter() {
        return;
    }
    // The edge x = 0 of a triangle that covers the left half of the image and much around it.
    let corners = [0.0, -50.0, 2.0, 0.0, 50.0, 2.0, -50.0, 0.0, 2.0];
    let faces: Arc<[[u32; 3]]> = [[0, 1, 2]].into();
    let softness = EdgeSoftness::new(Family::Logistic);
    let phi = tensor::<Gpu, 1>(&softness.default_phi(0.2), [1], DType::F32);
    let vertices = tensor::<Gpu, 3>(&corners, [1, 3, 3], DType::F32);
    let silhouette = Rasterizer::new(8).prepare(&faces, softness, &phi);
    let image: Vec<f64> = silhouette.coverage(vertices, phi).into_data().iter().collect();
    for (pixel, found) in image.into_iter().enumerate() {
        let x = (2.0 * (pixel % 8) as f64 + 1.0 - 8.0) / 8.0;
        let expected = 1.0 / (1.0 + (x / 0.2).exp());
        assert!((found - expected).abs() < 1e-5, "pixel {pixel}: {found}, not {expected}");
    }
}

#[test]
fn random_triangles_agree_with_the_reference() {
    if !adapter() {
        return;
    }
    for family in [Family::Logistic, Family::Exp] {
        let scene = random(EdgeSoftness::new(family), 0.05);
        let expected = Products::new::<NdArray<f64>>(&scene, DType::F64, Path::Reference);
        let found = Products::new::<Gpu>(&scene, DType::F32, Path::Fused);
        found.assert_close(&expected, &family.to_string());
    }
}

#[test]
fn scenes_agree_with_the_kernel_in_f64_to_second_order() {
    if !adapter() {
        return;
    }
    let squared = EdgeSoftness::squared(Family::Logistic);
    let sphere = seen(&icosphere(2), (17.3, &[4.1, 108.3, 211.9]), 32, squared, 1e-3);
    let fox = seen(&fox(), (17.3, &[171.7]), 50, squared, 1e-3);
    // A tail that is not 0 on the far side.
    let tail = random(EdgeSoftness::new(Family::Mlp), 0.05);
    // Images that are not square.
    let azimuths = [4.1, 108.3, 211.9];
    let [low, high] = [[20, 43], [51, 30]]
        .map(|size| seen(&icosphere(2), (17.3, &azimuths), size, squared, 1e-3));
    // Faces with more pixels than a part.
    let cut = seen(&icosphere(0), (17.3, &[4.1]), 150, squared, 1e-2);
    let scenes = [
        ("a sphere", sphere),
        ("a fox", fox),
        ("a tail", tail),
        ("faces in parts", cut),
        ("a low image", low),
        ("a high image", high),
    ];
    for (name, scene) in scenes {
        let expected = Products::new::<NdArray<f64>>(&scene, DType::F64, Path::Table);
        let found = Products::new::<Gpu>(&scene, DType::F32, Path::Table);
        found.assert_close(&expected, name);
    }
}

#[test]
fn more_views_than_a_launch_takes_are_drawn_in_parts() {
    if !adapter() {
        return;
    }
    // The last views differ from those of any earlier batch.
    let views = 65_540;
    let triangle = |view: usize| {
        let shift = if view < 65_530 { 0.0 } else { 0.01 * (view - 65_530) as f64 };
        [[-0.5, -0.4], [0.5, -0.6], [0.1, 0.5]].map(|[x, y]| [x + shift, y + shift, 2.0])
    };
    let vertices: Vec<f64> = (0..views).flat_map(triangle).flatten().collect();
    let faces: Arc<[[u32; 3]]> = [[0, 1, 2]].into();
    let softness = EdgeSoftness::new(Family::Logistic);
    let image = |first: usize, count: usize| -> Vec<f64> {
        let phi = tensor::<Gpu, 1>(&softness.default_phi(0.1), [1], DType::F32);
        let part = &vertices[9 * first..9 * (first + count)];
        let part = tensor::<Gpu, 3>(part, [count, 3, 3], DType::F32);
        let silhouette = Rasterizer::new(1).prepare(&faces, softness, &phi);
        silhouette.coverage(part, phi).into_data().iter().collect()
    };
    assert_eq!(image(0, views)[65_520..], image(65_520, 20));
}

#[test]
fn the_same_numbers_come_out_every_time() {
    if !adapter() {
        return;
    }
    let softness = EdgeSoftness::new(Family::Logistic);
    let sphere = seen(&icosphere(1), (17.3, &[0.0, 30.0]), 24, softness, 0.02);
    let cut = Scene { size: 150.into(), ..random(softness, 0.05) };
    for scene in [sphere, cut] {
        let products = || Products::new::<Gpu>(&scene, DType::F32, Path::Fused);
        assert_eq!(products(), products());
    }
}

/// Coverage of a scene under a T-conorm.
fn coverage<T: RasterBackend>(scene: &Scene, t_conorm: TConorm, dtype: DType) -> Vec<f64> {
    let Scene { views, size, softness, .. } = *scene;
    let phi = softness.default_phi(scene.scale);
    let exact = tensor::<NdArray<f64>, 1>(&phi, [phi.len()], DType::F64);
    let rasterizer = Rasterizer { tolerance: 1e-7, t_conorm, ..Rasterizer::new(size) };
    let silhouette = rasterizer.prepare(&scene.faces, softness, &exact);
    let table: Vec<f64> = silhouette.table_data(&phi).iter().collect();
    let count = scene.vertices.len() / 3 / views;
    let vertices = tensor::<T, 3>(&scene.vertices, [views, count, 3], dtype);
    let table = tensor::<T, 2>(&table, [table.len() / 4, 4], dtype);
    products::numbers(silhouette.coverage_by_table(vertices, table))
}

#[test]
fn every_t_conorm_gives_the_same_image_as_on_the_cpu() {
    if !adapter() {
        return;
    }
    let softness = EdgeSoftness::new(Family::Logistic);
    let scene = seen(&icosphere(2), (17.3, &[4.1, 108.3]), 40, softness, 0.03);
    let t_conorms = [
        TConorm::Probabilistic,
        TConorm::Einstein,
        TConorm::Hamacher(0.1),
        TConorm::Hamacher(7.0),
        TConorm::Frank(0.1),
        TConorm::Frank(9.0),
        TConorm::Yager(4.0),
        TConorm::AczelAlsina(2.0),
        TConorm::Dombi(2.0),
        TConorm::SchweizerSklar(-2.0),
    ];
    for t_conorm in t_conorms {
        let expected = coverage::<NdArray<f64>>(&scene, t_conorm, DType::F64);
        let found = coverage::<Gpu>(&scene, t_conorm, DType::F32);
        let off = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{t_conorm}: {off:.1e}");
        assert!(off <= 1e-5, "{t_conorm}: a pixel is off by {off:e}");
    }
}

#[test]
fn more_large_faces_than_can_be_cut_are_drawn_whole() {
    if !adapter() {
        return;
    }
    // A stack of one triangle: two parts of each would need more slots than there are.
    let (count, softness) = (2100, EdgeSoftness::new(Family::Logistic));
    let corners = [[-1.9, -0.9, 2.0], [1.9, -0.9, 2.0], [0.0, 0.9, 2.0]].concat();
    let faces: Arc<[[u32; 3]]> = vec![[0, 1, 2]; count].into();
    let scene =
        Scene { vertices: corners, views: 1, faces, size: 100.into(), softness, scale: 0.02 };
    let expected = coverage::<NdArray<f64>>(&scene, TConorm::Probabilistic, DType::F64);
    let found = coverage::<Gpu>(&scene, TConorm::Probabilistic, DType::F32);
    for (pixel, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert!((found - expected).abs() <= 1e-5, "pixel {pixel}: {found}, not {expected}");
    }
}

#[test]
fn broken_vertices_give_finite_numbers() {
    if !adapter() {
        return;
    }
    let softness = EdgeSoftness::new(Family::Logistic);
    let mut scene = random(softness, 0.05);
    let broken = [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e30, -1e30];
    for (face, value) in broken.into_iter().enumerate() {
        scene.vertices[9 * face + face % 3] = value;
    }
    let found = Products::new::<Gpu>(&scene, DType::F32, Path::Fused);
    assert!(found.image.iter().all(|a| (0.0..=1.0).contains(a)), "{:?}", found.image);
    for numbers in &found.products {
        assert!(numbers.iter().all(|x| x.is_finite()), "{numbers:?}");
    }
}
