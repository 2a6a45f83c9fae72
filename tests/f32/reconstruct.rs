//! Single-view reconstruction: pictures, template and smoothness.

use reconstruct::{Procedural, SIZE, Shapes, Smoothness, Split, Template, Voxels, orbit};
use softrast_raster::{HostBackend as Backend, hard_silhouette, project};
use softrast_tensor::{Tensor, TensorData};

/// Corners of the full cells as a point cloud, in world units.
fn centres(voxels: &Voxels) -> Vec<[f64; 3]> {
    let at = |cell: usize| (cell as f64 - 15.5) / 31.0;
    let full = voxels.in_file_order().iter().enumerate().filter(|(_, full)| **full);
    full.map(|(k, _)| [at(k / 32 % 32), at(k / 1024), at(31 - k % 32)]).collect()
}

fn projected(points: &[[f64; 3]], view: usize) -> Vec<[f64; 3]> {
    let points: Vec<f32> = points.iter().flatten().map(|&x| x as f32).collect();
    let count = points.len() / 3;
    let device = Default::default();
    let points = Tensor::<Backend, 3>::from_data(TensorData::new(points, [1, count, 3]), &device);
    let orbit = orbit(view).map(|x| x as f32);
    let orbit = Tensor::<Backend, 2>::from_data([orbit], &device);
    let values: Vec<f64> = project(points, orbit).tensor().into_data().iter().collect();
    values.chunks(3).map(|p| [p[0], p[1], p[2]]).collect()
}

#[test]
fn pictures_show_the_voxels_where_the_rasterizer_sees_them() {
    let shapes = Procedural::new(Split::Test, 5, 2);
    for class in 0..shapes.classes().len() {
        let voxels = shapes.voxels(class, 1).unwrap();
        for view in [0, 5, 17] {
            let planes = shapes.picture(class, 1, view).unwrap();
            let alpha = &planes[3 * SIZE * SIZE..];
            let pixel = |ndc: f64| ((ndc + 1.0) * SIZE as f64 / 2.0) as usize;
            let seen = projected(&centres(&voxels), view);
            let on = |p: &&[f64; 3]| alpha[pixel(-p[1]) * SIZE + pixel(p[0])] > 0;
            let share = seen.iter().filter(on).count() as f64 / seen.len() as f64;
            // Centres of cells next to the surface may be rounded to the pixel beyond its edge.
            assert!(share > 0.93, "class {class}, view {view}: {share}");
        }
    }
}

#[test]
fn the_template_is_a_sphere_until_it_is_moved_and_never_leaves_its_octants() {
    let device = Default::default();
    let template = Template::<Backend>::new(&device);
    let count = template.vertices();
    assert_eq!(count, 642);
    let still =
        template.deformed(Tensor::zeros([1, 3], &device), Tensor::zeros([1, 3, count], &device));
    let still: Vec<f64> = still.into_data().iter().collect();
    for v in 0..count {
        let square: f64 = (0..3).map(|k| still[k * count + v].powi(2)).sum();
        assert!((square.sqrt() - 0.25).abs() < 1e-6);
    }
    let far = Tensor::full([1, 3, count], 50.0, &device);
    let centre = Tensor::from_data([[0.3_f32, -0.2, 9.0]], &device);
    let moved: Vec<f64> = template.deformed(centre, far).into_data().iter().collect();
    for k in 0..3 * count {
        assert!(moved[k].abs() <= 0.5 + 1e-6);
        let centre = 0.5 * [0.3_f64, -0.2, 9.0][k / count].tanh();
        if still[k].abs() > 1e-6 {
            assert!((moved[k] - centre) * still[k] >= -1e-6);
        }
    }
}

#[test]
fn the_silhouette_of_the_template_is_a_disc() {
    let device = Default::default();
    let template = Template::<Backend>::new(&device);
    let count = template.vertices();
    let sphere =
        template.deformed(Tensor::zeros([1, 3], &device), Tensor::zeros([1, 3, count], &device));
    let orbit = Tensor::<Backend, 2>::from_data([orbit(3).map(|x| x as f32)], &device);
    let drawn = hard_silhouette(project(sphere.swap_dims(1, 2), orbit), template.faces(), SIZE);
    let area = drawn.sum().into_scalar() / (SIZE * SIZE) as f32 * 4.0;
    // From distance 2.732 with a half angle of 15 degrees: the tangent cone of the sphere.
    let radius = (0.25_f32 / 2.732).asin().tan() / 15_f32.to_radians().tan();
    assert!((area / (std::f32::consts::PI * radius * radius) - 1.0).abs() < 0.03, "{area}");
}

#[test]
fn smoothness_adds_up_what_was_worked_by_hand() {
    let device = Default::default();
    // Two triangles on the edge from 0 to 1, the second upright: a right angle, so (cos α + 1)² = 1.
    let points = [[0.0_f32, 1.0, 0.5, 0.5], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let smoothness = Smoothness::<Backend>::new(&[[0, 1, 2], [1, 0, 3]], 4, &device);
    // Neighbours: all except 2 and 3, which only have 0 and 1.
    let middle = |others: &[usize], k: usize| {
        others.iter().map(|&v| points[k][v]).sum::<f32>() / others.len() as f32
    };
    let neighbours: [&[usize]; 4] = [&[1, 2, 3], &[0, 2, 3], &[0, 1], &[0, 1]];
    let away = |v: usize, k: usize| points[k][v] - middle(neighbours[v], k);
    let laplacian: f32 =
        (0..4).flat_map(|v| (0..3).map(move |k| (v, k))).map(|(v, k)| away(v, k).powi(2)).sum();
    let expected = 5e-3 * laplacian + 5e-4;
    // The mean over two equal shapes is that of one.
    let found = smoothness.loss(Tensor::from_data([points, points], &device)).into_scalar();
    assert!((found - expected).abs() < 1e-6, "{found}, not {expected}");
    let collapsed = smoothness.loss(Tensor::zeros([1, 3, 4], &device)).into_scalar();
    assert!(collapsed.is_finite());
}
