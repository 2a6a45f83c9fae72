//! Images that are not square.

use softrast_raster::{
    ImageSize, Projected, TConorm, hard_silhouette, low_level::Rasterizer, reference,
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, vector};

use super::triangles::triangles;

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

const TOLERANCE: f64 = 1e-9;
const SCALE: f64 = 0.05;

fn assert_same(name: &str, found: &[f64], expected: &[f64], bound: f64) {
    let length = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    let error = length(&mut found.iter().zip(expected).map(|(a, b)| a - b));
    let size = length(&mut expected.iter().copied());
    assert!(size > 0.0 && error <= bound * size, "{name}: off by {:e}", error / size);
}

/// Image, gradients and their derivatives of some views.
fn passes(
    vertices: &[f64],
    phi: &[f64],
    views: usize,
    image: impl Fn(Tensor<AA, 3>, Tensor<AA, 1>) -> Tensor<AA, 3>,
) -> [Vec<f64>; 5] {
    let (inner_vertices, inner_phi) =
        (vector::<A>(vertices).require_grad(), vector::<A>(phi).require_grad());
    let outer = |inner: &Tensor<A, 1>| Tensor::<AA, 1>::from_inner(inner.clone()).require_grad();
    let (outer_vertices, outer_phi) = (outer(&inner_vertices), outer(&inner_phi));
    let shaped = outer_vertices.clone().reshape([views as i32, -1, 3]);
    let image = image(shaped, outer_phi.clone());
    let wave = |count: usize| -> Vec<f64> { (0..count).map(|i| (0.37 * i as f64).sin()).collect() };
    let flat = image.flatten::<1>(0, 2);
    let weights = vector::<AA>(&wave(flat.dims()[0]));
    let gradients = (flat.clone() * flat.clone() * weights).sum().backward();
    let to_vertices = outer_vertices.grad(&gradients).expect("a gradient to the vertices");
    let to_phi = outer_phi.grad(&gradients).expect("a gradient to the parameters");
    let product = (to_vertices.clone() * vector(&wave(vertices.len()))).sum()
        + (to_phi.clone() * vector(&wave(phi.len()))).sum();
    let again = product.backward();
    [
        numbers(flat.inner().inner()),
        numbers(to_vertices.inner()),
        numbers(to_phi.inner()),
        numbers(inner_vertices.grad(&again).expect("second order to the vertices")),
        numbers(inner_phi.grad(&again).expect("second order to the parameters")),
    ]
}

#[test]
fn any_image_agrees_with_the_reference_to_second_order() {
    let (one, faces) = triangles(7, 12);
    // Three different views.
    let vertices: Vec<f64> = (0..3)
        .flat_map(|view| one.iter().map(move |x| x * (1.0 - 0.1 * f64::from(view))))
        .collect();
    for (family, size) in [(Family::Logistic, [7, 16]), (Family::Exp, [16, 5])] {
        let softness = EdgeSoftness::new(family);
        let phi = softness.default_phi(SCALE);
        let fused = |vertices, phi: Tensor<AA, 1>| {
            let rasterizer = Rasterizer { tolerance: TOLERANCE, ..Rasterizer::new(size) };
            rasterizer.prepare(&faces, softness, &phi).coverage(vertices, phi)
        };
        let dense = |vertices: Tensor<AA, 3>, phi: Tensor<AA, 1>| {
            let scene = reference::Scene { faces: &faces, size: size.into() };
            let conorm = TConorm::Probabilistic;
            conorm.coverage(reference::sums(scene, vertices, &softness, conorm, phi))
        };
        let (found, expected) =
            (passes(&vertices, &phi, 3, fused), passes(&vertices, &phi, 3, dense));
        let bounds = [1e-8, 1e-6, 2e-6, 1e-4, 1e-4];
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_same(&format!("{family}, quantity {k}"), found, expected, bounds[k]);
        }
    }
}

#[test]
fn a_lower_image_shows_the_middle_of_a_square_one() {
    const SIDE: usize = 16;
    let (values, faces) = triangles(7, 12);
    let softness = EdgeSoftness::new(Family::Gauss);
    // The lower image has half as many rows, so its pixels are twice as large.
    let drawn = |size: ImageSize, factor: f64| {
        let along = |(k, x): (usize, &f64)| if k % 3 < 2 { factor * x } else { *x };
        let values: Vec<f64> = values.iter().enumerate().map(along).collect();
        let vertices = vector::<B>(&values).reshape([1, -1, 3]);
        let phi = vector(&softness.default_phi(0.05 * factor));
        let rasterizer = Rasterizer { tolerance: TOLERANCE, ..Rasterizer::new(size) };
        let soft = rasterizer.prepare(&faces, softness, &phi).coverage(vertices.clone(), phi);
        [numbers(soft), numbers(hard_silhouette(Projected::new(vertices), &faces, size))]
    };
    let square = drawn(SIDE.into(), 1.0);
    let rows = SIDE * SIDE / 4..3 * SIDE * SIDE / 4;
    let columns = |image: &[f64]| -> Vec<f64> {
        let row = |row: &[f64]| row[SIDE / 4..3 * SIDE / 4].to_vec();
        image.chunks(SIDE).flat_map(row).collect()
    };
    for (found, whole) in drawn([SIDE / 2, SIDE].into(), 2.0).iter().zip(&square) {
        assert_same("a low image", found, &whole[rows.clone()], 1e-8);
    }
    for (found, whole) in drawn([SIDE, SIDE / 2].into(), 2.0).iter().zip(&square) {
        assert_same("a narrow image", found, &columns(whole), 1e-8);
    }
}
