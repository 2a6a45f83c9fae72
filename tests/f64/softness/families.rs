//! Every family compared with differences of itself, in f64.

use softrast_softness::{EdgeSoftness, Family, OPAQUE, Softness};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::vector;

use super::numbers;

type Plain = NdArray<f64>;
type First = Autodiff<Plain>;
type Second = Autodiff<First>;

const SCALE: f64 = 0.3;

/// Step of a central difference, in scales: its error is about 1e-10 for a smooth function.
const STEP: f64 = 1e-5;

/// Distances in scales, clear of the kinks at 0 and ±1 and of the point where Gamma changes method.
const DISTANCES: [f64; 18] = [
    -23.7, -11.3, -6.1, -2.9, -1.3, -0.77, -0.41, -0.17, -0.093, 0.087, 0.19, 0.43, 0.71, 1.37,
    3.1, 5.9, 12.1, 24.3,
];

/// Families, for the distance and the squared distance, with φ away from its defaults.
fn cases() -> Vec<(EdgeSoftness, Vec<f64>)> {
    let families = Family::ALL
        .into_iter()
        .flat_map(|family| [EdgeSoftness::new, EdgeSoftness::squared].map(|edge| edge(family)));
    let mut cases: Vec<_> =
        families.map(|softness| (softness, softness.default_phi(SCALE))).collect();
    for shape in [0.3_f64, 1.0, 2.7, 6.0] {
        for family in [Family::Gamma, Family::GammaForward] {
            let phi = vec![SCALE.ln(), shape.ln(), 0.05];
            cases.push((EdgeSoftness::new(family), phi));
        }
    }
    cases
}

fn distances(softness: EdgeSoftness) -> Vec<f64> {
    let x = DISTANCES.map(|u| u * SCALE);
    if softness.scale_is_squared() {
        x.map(|x| x.abs().sqrt().copysign(x)).to_vec()
    } else {
        x.to_vec()
    }
}

#[derive(Clone, Copy, Debug)]
enum Curve {
    Value,
    Density,
    Depth,
    Hazard,
}

impl Curve {
    fn of<B: Backend>(self, s: EdgeSoftness, phi: Tensor<B, 1>, x: Tensor<B, 1>) -> Tensor<B, 1> {
        match self {
            Self::Value => s.value(phi, x),
            Self::Density => s.density(phi, x),
            Self::Depth => s.optical_depth(phi, x),
            Self::Hazard => s.hazard(phi, x),
        }
    }

    fn at(self, softness: EdgeSoftness, phi: &[f64], x: &[f64]) -> Vec<f64> {
        numbers(self.of::<Plain>(softness, vector(phi), vector(x)))
    }
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64], relative: f64, absolute: f64, what: &str) {
    for (k, (&f, &e)) in found.iter().zip(expected).enumerate() {
        let error = (f - e).abs();
        assert!(error <= absolute + relative * e.abs(), "{what} [{k}]: {f:e}, expected {e:e}");
    }
}

#[test]
fn derivatives_match_central_differences() {
    for (softness, phi) in cases() {
        let x = distances(softness);
        let step = STEP * SCALE;
        let [ahead, behind] =
            [step, -step].map(|step| x.iter().map(|x| x + step).collect::<Vec<_>>());
        for (curve, derivative) in [(Curve::Value, Curve::Density), (Curve::Depth, Curve::Hazard)] {
            let [high, low] = [&ahead, &behind].map(|x| curve.at(softness, &phi, x));
            let slopes: Vec<_> =
                high.iter().zip(&low).map(|(high, low)| (high - low) / (2.0 * step)).collect();
            let what = format!("{derivative:?} of {softness:?} {phi:?}");
            assert_close(&derivative.at(softness, &phi, &x), &slopes, 1e-7, 3e-7, &what);
        }
    }
}

#[test]
fn derivatives_match_automatic_ones_to_the_last_digits() {
    for (softness, phi) in cases() {
        let x = distances(softness);
        for (curve, derivative) in [(Curve::Value, Curve::Density), (Curve::Depth, Curve::Hazard)] {
            let at = vector::<First>(&x).require_grad();
            let grads = curve.of(softness, vector(&phi), at.clone()).sum().backward();
            let slopes = numbers(at.grad(&grads).unwrap());
            let what = format!("{derivative:?} of {softness:?} {phi:?}");
            assert_close(&derivative.at(softness, &phi, &x), &slopes, 1e-12, 1e-300, &what);
        }
    }
}

#[test]
fn optical_depth_is_that_of_the_value() {
    for (softness, phi) in cases() {
        let x = distances(softness);
        let value = Curve::Value.at(softness, &phi, &x);
        let depth = Curve::Depth.at(softness, &phi, &x);
        for ((s, q), x) in value.into_iter().zip(depth).zip(x) {
            assert!((0.0..=1.0).contains(&s), "{softness:?} at {x}: {s}");
            assert!(q >= 0.0, "{softness:?} at {x}: {q}");
            if s < 0.9 {
                let expected = -(-s).ln_1p();
                let error = (q - expected).abs();
                assert!(error <= 1e-14 + 12.0 * OPAQUE * s, "{softness:?} at {x}: {q} {expected}");
            }
        }
    }
}

#[test]
fn families_rise_from_outside_to_inside() {
    for (softness, phi) in cases() {
        let x: Vec<_> = (-2000..=2000).map(|k| f64::from(k) * 2e-3).collect();
        for curve in [Curve::Value, Curve::Depth] {
            let y = curve.at(softness, &phi, &x);
            let falls = y.windows(2).find(|pair| pair[1] < pair[0] * (1.0 - 1e-14));
            assert_eq!(falls, None, "{curve:?} of {softness:?} {phi:?}");
        }
    }
}

#[test]
fn automatic_derivatives_are_right_at_the_edge_itself() {
    for family in Family::ALL {
        let softness = EdgeSoftness::new(family);
        let phi = family.default_phi(SCALE);
        for (curve, derivative) in [(Curve::Value, Curve::Density), (Curve::Depth, Curve::Hazard)] {
            let (slope, _, curvature) = second_order(curve, softness, &phi, &[0.0]);
            let what = format!("{derivative:?} of {family} at 0");
            assert_close(&slope, &derivative.at(softness, &phi, &[0.0]), 1e-12, 0.0, &what);
            let kinked = ["exp", "gamma", "laplace", "reciprocal"];
            if !kinked.iter().any(|kinked| family.name().starts_with(kinked)) {
                let step = 1e-5 * SCALE;
                let high = derivative.at(softness, &phi, &[step])[0];
                let low = derivative.at(softness, &phi, &[-step])[0];
                let expected = (high - low) / (2.0 * step);
                assert_close(&curvature, &[expected], 1e-6, 1e-5, &what);
            }
        }
    }
}

/// The gradient of `Σ curve` with respect to φ.
fn gradient(curve: Curve, softness: EdgeSoftness, phi: &[f64], x: &[f64]) -> Vec<f64> {
    let at = vector::<First>(phi).require_grad();
    let grads = curve.of(softness, at.clone(), vector(x)).sum().backward();
    numbers(at.grad(&grads).expect("φ has a gradient"))
}

/// Central difference of `f` along entry `k` of `phi`.
fn along(phi: &[f64], k: usize, f: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let [high, low] = [STEP, -STEP].map(|step| {
        let mut phi = phi.to_vec();
        phi[k] += step;
        f(&phi)
    });
    high.iter().zip(&low).map(|(high, low)| (high - low) / (2.0 * STEP)).collect()
}

#[test]
fn gradients_to_phi_match_central_differences() {
    for (softness, phi) in cases() {
        let x = distances(softness);
        for curve in [Curve::Value, Curve::Density, Curve::Depth, Curve::Hazard] {
            let found = gradient(curve, softness, &phi, &x);
            for (k, found) in found.into_iter().enumerate() {
                let slope: f64 = along(&phi, k, |phi| curve.at(softness, phi, &x)).iter().sum();
                let what = format!("{curve:?} of {softness:?} by phi[{k}]");
                assert_close(&[found], &[slope], 1e-6, 1e-6, &what);
            }
        }
    }
}

/// `∂/∂x` of every point, and the gradients of its sum with respect to φ and to x.
fn second_order(
    curve: Curve,
    softness: EdgeSoftness,
    phi: &[f64],
    x: &[f64],
) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let phi = vector::<First>(phi).require_grad();
    let x = vector::<First>(x).require_grad();
    let outer_x = Tensor::<Second, 1>::from_inner(x.clone()).require_grad();
    let y = curve.of(softness, Tensor::from_inner(phi.clone()), outer_x.clone());
    let slope = outer_x.grad(&y.sum().backward()).expect("x has a gradient");
    let grads = slope.clone().sum().backward();
    let zeros = |like: &Tensor<First, 1>| like.clone().inner().zeros_like();
    let by_phi = phi.grad(&grads).unwrap_or_else(|| zeros(&phi));
    let by_x = x.grad(&grads).unwrap_or_else(|| zeros(&x));
    (numbers(slope.inner()), numbers(by_phi), numbers(by_x))
}

#[test]
fn second_order_gradients_match_central_differences() {
    for (softness, phi) in cases() {
        let x = distances(softness);
        for (curve, derivative) in [(Curve::Value, Curve::Density), (Curve::Depth, Curve::Hazard)] {
            let (slope, by_phi, by_x) = second_order(curve, softness, &phi, &x);
            let what = format!("second order of {curve:?}, {softness:?} {phi:?}");
            assert_close(&slope, &derivative.at(softness, &phi, &x), 1e-11, 1e-12, &what);

            for (k, found) in by_phi.into_iter().enumerate() {
                let mixed = along(&phi, k, |phi| derivative.at(softness, phi, &x));
                assert_close(&[found], &[mixed.iter().sum()], 1e-6, 1e-5, &what);
            }

            let step = STEP * SCALE;
            let [high, low] = [step, -step].map(|step| {
                let x: Vec<_> = x.iter().map(|x| x + step).collect();
                derivative.at(softness, &phi, &x)
            });
            let curvature: Vec<_> =
                high.iter().zip(&low).map(|(high, low)| (high - low) / (2.0 * step)).collect();
            assert_close(&by_x, &curvature, 1e-6, 1e-5, &what);
        }
    }
}
