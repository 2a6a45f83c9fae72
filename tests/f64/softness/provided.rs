//! Provided methods of a softness: density, optical depth and hazard from its value.

use softrast_raster::low_level::Rasterizer;
use softrast_softness::{Family, OPAQUE, Softness};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::{tensor, vector};

use super::numbers;

type Plain = NdArray<f64>;
type First = Autodiff<Plain>;
type Second = Autodiff<First>;

const SCALE: f64 = 0.3;
/// Distances in scales, clear of kinks, where 1 - s has digits.
const DISTANCES: [f64; 8] = [-0.93, -0.7, -0.41, -0.09, 0.087, 0.43, 0.71, 0.95];

/// A family with nothing but its value and the number of its parameters.
#[derive(Clone, Debug)]
pub(crate) struct ValueOf(pub(crate) Family);

impl Softness for ValueOf {
    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        self.0.value(phi, x)
    }

    fn parameters(&self) -> usize {
        self.0.parameters()
    }
}

#[derive(Clone, Copy, Debug)]
enum Curve {
    Density,
    Depth,
    Hazard,
}

impl Curve {
    fn of<B: Backend>(self, s: &impl Softness, phi: Tensor<B, 1>, x: Tensor<B, 1>) -> Tensor<B, 1> {
        match self {
            Self::Density => s.density(phi, x),
            Self::Depth => s.optical_depth(phi, x),
            Self::Hazard => s.hazard(phi, x),
        }
    }
}

/// A curve; the gradients of its weighted sum with respect to φ and to x; and those of a weighted sum of these.
fn derivatives(curve: Curve, softness: &impl Softness, phi: &[f64]) -> [Vec<f64>; 5] {
    let weights = |count: usize| -> Vec<f64> { (1..=count).map(|k| (k as f64).sin()).collect() };
    let inner = [vector::<First>(phi), vector(&DISTANCES.map(|u| u * SCALE))];
    let inner = inner.map(Tensor::require_grad);
    let outer = inner.clone().map(|leaf| Tensor::<Second, 1>::from_inner(leaf).require_grad());
    let y = curve.of(softness, outer[0].clone(), outer[1].clone());
    let grads = (y.clone() * vector(&weights(DISTANCES.len()))).sum().backward();
    let first = outer.map(|leaf| leaf.grad(&grads).expect("the outer level is tracked"));
    let sums = first.clone().map(|grad| (grad.clone() * vector(&weights(grad.dims()[0]))).sum());
    let [by_phi, by_x] = sums;
    let grads = (by_phi + by_x).backward();
    let second = inner.map(|leaf| leaf.grad(&grads).expect("the inner level is tracked"));
    let ([a, b], [c, d]) = (first.map(Tensor::inner), second);
    [y.inner().inner(), a, b, c, d].map(numbers)
}

#[track_caller]
fn assert_same(curve: Curve, family: Family) {
    let phi = family.default_phi(SCALE);
    let provided = derivatives(curve, &ValueOf(family), &phi);
    let own = derivatives(curve, &family, &phi);
    // The second derivative of the fitted series of the error function has fewer digits.
    let tolerance = if family == Family::Gauss { 1e-6 } else { 1e-11 };
    let parts = ["value", "to φ", "to x", "to φ, second order", "to x, second order"];
    for ((found, expected), part) in provided.iter().zip(&own).zip(parts) {
        let what = format!("{curve:?} of {family}, {part}: {found:?}, not {expected:?}");
        let size = expected.iter().fold(0.0_f64, |size, e| size.max(e.abs()));
        assert!(size > 0.0, "{what}");
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() <= tolerance * size, "{what}");
        }
    }
}

#[test]
fn the_density_of_a_value_alone_is_the_one_by_formula_to_second_order() {
    for family in Family::ALL {
        // Before its start a law is all zeros, and a straight line has no curvature to track.
        if family != Family::Uniform {
            assert_same(Curve::Density, family);
        }
    }
}

#[test]
fn the_hazard_of_a_value_alone_is_the_one_by_formula_to_second_order() {
    // Families whose own optical depth is bounded too.
    for family in [Family::CubicHermite, Family::Wigner, Family::Gamma, Family::Levy, Family::Exp] {
        assert_same(Curve::Depth, family);
        assert_same(Curve::Hazard, family);
    }
}

#[test]
fn the_optical_depth_of_a_value_alone_is_that_of_what_it_leaves_open() {
    let x = vector::<Plain>(&[-1e9, -3.0, -0.5, 0.0, 0.2, 1.0, 1e9]);
    for family in Family::ALL {
        let phi = vector(&family.default_phi(SCALE));
        let s = numbers(family.value(phi.clone(), x.clone()));
        let q = numbers(ValueOf(family).optical_depth(phi, x.clone()));
        for (s, q) in s.into_iter().zip(q) {
            let expected = -(OPAQUE + (1.0 - OPAQUE) * (1.0 - s)).ln();
            assert!((q - expected).abs() <= 1e-9, "{family}: {q}, not {expected} at s = {s}");
        }
    }
}

#[test]
fn the_first_parameter_of_a_value_alone_is_the_logarithm_of_its_scale() {
    let own = ValueOf(Family::GammaForward);
    assert_eq!(own.default_phi(0.5), [0.5_f64.ln(), 0.0, 0.0]);
    assert_eq!((own.logarithms(), own.scale(&[2.0, 1.0, 3.0])), (1, 2.0_f64.exp()));
    let wide = [2.0 + 0.5_f64.ln(), 1.0, 3.0];
    assert_eq!(own.with_scale_values(&[2.0, 1.0, 3.0], 0.5), wide);
    let found = own.with_scale(vector::<Plain>(&[2.0, 1.0, 3.0]), vector(&[0.5]));
    assert_eq!(numbers(found), wide);
}

/// An image, and the gradients of a weighted sum of its pixels with respect to φ and to the corners.
fn drawn(softness: impl Softness) -> [Vec<f64>; 3] {
    const SIZE: usize = 16;
    let corners = [-0.6, -0.5, 1.0, 0.7, -0.4, 1.0, 0.1, 0.6, 1.0];
    let corners = vector::<First>(&corners).require_grad();
    let phi = vector::<First>(&Family::Logistic.default_phi(0.1)).require_grad();
    let silhouette = Rasterizer::new(SIZE).prepare(&[[0, 1, 2]].into(), softness, &phi);
    let image = silhouette.coverage(corners.clone().reshape([1, 3, 3]), phi.clone());
    let weights: Vec<f64> = (0..SIZE * SIZE).map(|k| (0.37 * k as f64).sin()).collect();
    let grads = (image.clone() * tensor(&weights, [1, SIZE, SIZE])).sum().backward();
    let image = image.inner().reshape([SIZE * SIZE]);
    [image, phi.grad(&grads).unwrap(), corners.grad(&grads).unwrap()].map(numbers)
}

#[test]
fn a_value_alone_is_rasterized_as_the_family_is() {
    let (found, expected) = (drawn(ValueOf(Family::Logistic)), drawn(Family::Logistic));
    for (found, expected) in found.iter().zip(&expected) {
        let size = expected.iter().fold(0.0_f64, |size, e| size.max(e.abs()));
        for (f, e) in found.iter().zip(expected) {
            // Twice the default tolerance of the rasterizer.
            assert!((f - e).abs() <= 2.0 * Rasterizer::TOLERANCE * size, "{f}, not {e}");
        }
    }
}

/// One half everywhere.
#[derive(Clone, Debug)]
struct Flat;

impl Softness for Flat {
    fn value<B: Backend, const D: usize>(
        &self,
        _phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        x.zeros_like() + 0.5
    }
}

#[test]
fn a_value_that_does_not_depend_on_the_distance_has_no_density() {
    let (phi, x) = (vector::<Plain>(&[0.0]), vector(&[-1.0, 0.0, 2.0]));
    assert_eq!(numbers(Flat.density(phi.clone(), x.clone())), [0.0; 3]);
    assert_eq!(numbers(Flat.hazard(phi, x)), [0.0; 3]);
}
