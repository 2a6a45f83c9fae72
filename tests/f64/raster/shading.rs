//! Lighting of surfaces: by hand, by sums over a sphere, and derivatives compared with central differences.

use softrast_mesh::icosphere;
use softrast_raster::{Light, lambert, phong, spherical_harmonics, vertex_normals};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::{numbers, tensor, vector};

use super::losses::{Of, assert_derivatives, derivatives, wave};

type B = NdArray<f64>;
type AA = Autodiff<Autodiff<B>>;

const FACES: [[u32; 3]; 4] = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [3, 2, 1]];

fn lights<T: Backend>(towards: [f64; 3], place: [f64; 3]) -> [Light<T>; 2] {
    let [far, near] = [[1.0, 0.5, 0.25], [0.2, 0.4, 0.8]].map(|colour| vector(&colour));
    [
        Light::Directional { towards: vector(&towards), colour: far },
        Light::Point { place: vector(&place), colour: near },
    ]
}

fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-12, "{found:?} instead of {expected:?}");
    }
}

#[test]
fn normals_of_a_sphere_point_away_from_its_middle() {
    let sphere = icosphere(2);
    for scale in [1e-8, 1.0, 1e8] {
        let places: Vec<f64> = sphere.positions().iter().flatten().map(|x| scale * x).collect();
        let vertices = tensor::<B, 3>(&places, [1, places.len() / 3, 3]);
        let normals = numbers(vertex_normals(vertices, sphere.faces()));
        for (normal, place) in normals.chunks(3).zip(sphere.positions()) {
            let along: f64 = (0..3).map(|k| normal[k] * place[k]).sum();
            let length: f64 = normal.iter().map(|x| x * x).sum();
            assert!(along > 0.999 && (length - 1.0).abs() < 1e-12, "{normal:?} {place:?}");
        }
    }
}

#[test]
fn light_worked_by_hand() {
    // A point at (0, 0, 1) with normal +z; a light 3 to its right and 4 up; an eye on the mirrored ray.
    let points = tensor::<B, 3>(&[0.0, 0.0, 1.0], [1, 1, 3]);
    let normals = tensor::<B, 3>(&[0.0, 0.0, 7.0], [1, 1, 3]);
    let lights = lights([0.0, 0.0, 2.0], [3.0, 0.0, 5.0]);
    let dull = numbers(lambert(points.clone(), normals.clone(), &lights));
    assert_close(&dull, &[1.0 + 0.2 * 0.8, 0.5 + 0.4 * 0.8, 0.25 + 0.8 * 0.8]);
    let eye = tensor::<B, 2>(&[-6.0, 0.0, 9.0], [1, 3]);
    let shine = numbers(phong(points.clone(), normals.clone(), eye, &lights[1..], 5.0));
    assert_close(&shine, &[0.2, 0.4, 0.8]);
    // The directional light is reflected along z, at the cosine 0.8 of the eye.
    let eye = tensor::<B, 2>(&[-6.0, 0.0, 9.0], [1, 3]);
    let shine = numbers(phong(points.clone(), normals.clone(), eye, &lights[..1], 2.0));
    assert_close(&shine, &[0.64, 0.32, 0.16]);
    // No light arrives from behind.
    let eye = tensor::<B, 2>(&[-6.0, 0.0, 9.0], [1, 3]);
    assert_close(&numbers(lambert(points.clone(), -normals.clone(), &lights)), &[0.0; 3]);
    assert_close(&numbers(phong(points, -normals, eye, &lights, 2.0)), &[0.0; 3]);
}

#[test]
fn spherical_harmonics_are_orthonormal() {
    let sphere = icosphere(5);
    let count = sphere.positions().len();
    let normals = tensor::<B, 3>(sphere.positions().as_flattened(), [1, count, 3]);
    let unit: Vec<f64> = (0..81).map(|k| f64::from(u8::from(k % 10 == 0))).collect();
    let harmonics = numbers(spherical_harmonics(normals, tensor(&unit, [9, 9])));
    // Vertices are not evenly distributed, so each is weighted by the area around it.
    let mut areas = vec![0.0; count];
    for (face, [a, b, c]) in sphere.faces().iter().zip(sphere.triangles()) {
        let [u, v] = [b, c].map(|p| [0, 1, 2].map(|k| p[k] - a[k]));
        let normal = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| u[i] * v[j] - u[j] * v[i]);
        let area = normal.iter().map(|x| x * x).sum::<f64>().sqrt() / 6.0;
        face.iter().for_each(|&v| areas[v as usize] += area);
    }
    for i in 0..9 {
        for j in 0..9 {
            let product = |v: usize| areas[v] * harmonics[9 * v + i] * harmonics[9 * v + j];
            let sum: f64 = (0..count).map(product).sum();
            let expected = f64::from(u8::from(i == j));
            assert!((sum - expected).abs() < 3e-3, "{i} {j}: {sum}");
        }
    }
}

fn points(x: &Tensor<AA, 1>) -> Tensor<AA, 3> {
    x.clone().narrow(0, 0, 12).reshape([1, 4, 3])
}

fn eyes(x: &Tensor<AA, 1>) -> Tensor<AA, 2> {
    x.clone().narrow(0, 12, 3).reshape([1, 3])
}

fn shaded(x: Tensor<AA, 1>) -> Tensor<AA, 1> {
    let (points, lights) = (points(&x), lights::<AA>([0.2, 0.9, 0.4], [0.3, 2.0, -1.0]));
    let normals = vertex_normals(points.clone(), &FACES);
    let dull = lambert(points.clone(), normals.clone(), &lights);
    let shiny = phong(points, normals.clone(), eyes(&x), &lights, 3.0);
    let coefficients = tensor(&wave(27, 0.6), [9, 3]);
    (dull + shiny + spherical_harmonics(normals, coefficients)).flatten(0, 2)
}

#[test]
fn shading_has_both_derivatives_also_where_there_is_no_normal() {
    let of: Of = shaded;
    assert_derivatives(of, &wave(15, 1.3));
    for at in [0.0, 0.3] {
        // All vertices at one position: no face has an area.
        let [gradient, second] = derivatives(of, &[at; 15], &wave(15, 2.1));
        assert!(gradient.iter().chain(&second).all(|g| g.is_finite()), "{gradient:?} {second:?}");
    }
}
