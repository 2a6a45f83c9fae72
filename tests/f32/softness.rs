//! Extreme distances and scales in f32: everything stays finite, gradients included.

use proptest::prelude::*;
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, DType, NdArray, Tensor, TensorData, numbers, vector};

type First = Autodiff<NdArray<f32>>;
type Second = Autodiff<First>;

/// The smallest scale at which second derivatives (and the gradients of density and hazard) are required to be finite: at the edge, the
/// optical depth of Gamma has one of 1e22 / scale², which overflows f32 for smaller scales.
const SECOND_ORDER_FROM: f64 = 1e-7;

const SCALES: [f64; 7] = [1e-12, 1e-7, 1e-4, 1e-2, 1.0, 30.0, 1e3];

/// 0, and both signs of distances from the smallest to the largest.
fn distances() -> Vec<f64> {
    let sizes = [1e-38, 1e-20, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 0.1, 1.0, 3.0, 40.0, 1e3, 1e6];
    sizes.into_iter().flat_map(|x| [-x, x]).chain([0.0]).collect()
}

/// Distances around 0, where the terms of every formula are exchanged.
fn near(scale: f64) -> impl Iterator<Item = f64> {
    (-120..=120).map(move |k| f64::from(k) / 10.0 * scale)
}

fn softnesses() -> impl Iterator<Item = EdgeSoftness> {
    Family::ALL
        .into_iter()
        .flat_map(|family| [EdgeSoftness::new, EdgeSoftness::squared].map(|edge| edge(family)))
}

#[track_caller]
fn assert_finite<B: Backend>(found: Option<Tensor<B, 1>>, what: &str) {
    let Some(found) = found else { return };
    for (k, number) in numbers(found).into_iter().enumerate() {
        assert!(number.is_finite(), "{what} [{k}] is {number}");
    }
}

/// Value, optical depth and their derivatives with respect to x, with the gradients of each.
fn check(softness: EdgeSoftness, scale: f64, x: &[f64]) {
    let phi = vector::<First>(&softness.default_phi(scale)).require_grad();
    let x = vector::<First>(x).require_grad();
    let outer_x = Tensor::<Second, 1>::from_inner(x.clone()).require_grad();
    let outer_phi = Tensor::<Second, 1>::from_inner(phi.clone()).require_grad();
    let curves = [
        softness.value(outer_phi.clone(), outer_x.clone()),
        softness.optical_depth(outer_phi.clone(), outer_x.clone()),
        softness.density(outer_phi.clone(), outer_x.clone()),
        softness.hazard(outer_phi.clone(), outer_x.clone()),
    ];
    for (k, curve) in curves.into_iter().enumerate() {
        let what = format!("curve {k} of {softness:?}");
        assert_finite(Some(curve.clone().inner().inner()), &what);
        if k >= 2 && scale < SECOND_ORDER_FROM {
            continue;
        }
        let grads = curve.sum().backward();
        for (which, slope) in [outer_x.grad(&grads), outer_phi.grad(&grads)].into_iter().enumerate()
        {
            let Some(slope) = slope else { continue };
            let what = format!("gradient {which} of {what}");
            assert_finite(Some(slope.clone().inner()), &what);
            if k < 2 && scale >= SECOND_ORDER_FROM {
                let grads = slope.sum().backward();
                assert_finite(x.grad(&grads), &format!("{what}, by x"));
                assert_finite(phi.grad(&grads), &format!("{what}, by phi"));
            }
        }
    }
}

#[test]
fn everything_is_finite_at_extreme_distances() {
    for softness in softnesses() {
        for scale in SCALES {
            check(softness, scale, &distances());
        }
    }
}

#[test]
fn everything_is_finite_around_the_edge() {
    for softness in softnesses() {
        for scale in SCALES {
            let x: Vec<_> = near(scale).collect();
            check(softness, scale, &x);
        }
    }
}

#[test]
fn values_are_those_of_f64_to_the_digits_of_f32() {
    for family in Family::ALL {
        let x: Vec<_> = near(0.01).collect();
        let phi = family.default_phi(0.01);
        let single = numbers(family.value::<NdArray<f32>, 1>(vector(&phi), vector(&x)));
        let as_f64 = |values: &[f64]| {
            let data = TensorData::new(values.to_vec(), [values.len()]);
            Tensor::<NdArray<f32>, 1>::from_data(data, (&Default::default(), DType::F64))
        };
        let double = family.value(as_f64(&phi), as_f64(&x)).into_data();
        for (s, d) in single.into_iter().zip(double.iter::<f64>()) {
            assert!((s - d).abs() < 2e-5, "{family}: {s}, expected {d}");
        }
    }
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(64))]

    #[test]
    fn any_distance_and_scale_gives_a_value_between_zero_and_one(
        family in prop::sample::select(&Family::ALL[..]),
        squared: bool,
        scale in (-27.6_f64..6.9).prop_map(f64::exp),
        x in prop::collection::vec(-1e6_f64..1e6, 1..20),
    ) {
        let softness = if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
        let phi = softness.default_phi(scale);
        check(softness, scale, &x);
        let x: Vec<_> = x.iter().map(|x| x * scale / 1e5).collect();
        check(softness, scale, &x);
        for s in numbers(softness.value::<NdArray<f32>, 1>(vector(&phi), vector(&x))) {
            prop_assert!((0.0..=1.0).contains(&s));
        }
    }
}
