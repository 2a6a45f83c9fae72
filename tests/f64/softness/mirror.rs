//! The logarithm of a softness, far into its tails.

use softrast_softness::{EdgeSoftness, Family, Mirrored, OPAQUE, Softness};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::{numbers, vector};

use super::provided::ValueOf;

type B = NdArray<f64>;

#[test]
fn the_exponential_of_the_logarithm_is_the_value() {
    let x = [-0.4, -0.11, -0.02, 0.0, 0.03, 0.2, 0.7];
    for family in Family::ALL {
        for edge in [EdgeSoftness::new, EdgeSoftness::squared] {
            let softness = edge(family);
            let phi = vector::<B>(&softness.default_phi(0.1));
            let log = numbers(softness.log_value(phi.clone(), vector(&x)));
            let value = numbers(softness.value(phi, vector(&x)));
            for ((x, log), value) in x.iter().zip(log).zip(value) {
                let off = (log.exp() - value).abs();
                let name = format!("{softness:?}, x = {x}");
                assert!(off <= 1.1 * OPAQUE, "{name}: exp({log}) and {value}");
                assert!(log <= 0.0, "{name}: {log}");
            }
        }
    }
}

#[test]
fn tails_that_underflow_keep_their_logarithm() {
    let log = |family: Family| -> f64 {
        let phi = vector::<B>(&family.default_phi(1e-3));
        let softness = EdgeSoftness::new(family);
        softness.log_value(phi, vector(&[-2.0])).into_scalar()
    };
    assert!((log(Family::Logistic) + 2000.0).abs() < 1e-9);
    assert!((log(Family::Exp) + 2000.0).abs() < 1e-9);
    // ln Φ(-u) = -u²/2 - ln(u sqrt(2π)) + O(u⁻²).
    let u: f64 = 2000.0;
    let expected = -0.5 * u * u - (u * (2.0 * std::f64::consts::PI).sqrt()).ln();
    assert!((log(Family::Gauss) - expected).abs() < 1e-5);
    assert!((log(Family::Uniform) - OPAQUE.ln()).abs() < 1e-12);
}

#[test]
fn a_mirrored_family_is_the_family_of_the_mirrored_law() {
    let x = [-0.4, -0.11, -0.02, 0.0, 0.03, 0.2, 0.7];
    for family in Family::ALL {
        for edge in [EdgeSoftness::new, EdgeSoftness::squared] {
            let (softness, other) = (edge(family), edge(family.mirrored()));
            let phi = vector::<B>(&softness.default_phi(0.1));
            let depths = Mirrored(softness).depth_and_hazard(phi.clone(), vector(&x));
            let expected = other.depth_and_hazard(phi, vector(&x));
            assert_eq!(depths.map(numbers), expected.map(numbers), "{softness:?}");
        }
    }
}

#[test]
fn what_is_provided_is_the_logarithm_and_its_slope() {
    // Where the value is far above the floor of the provided logarithm.
    let x = [-0.2, -0.05, 0.0, 0.03, 0.2];
    for family in [Family::Logistic, Family::Gauss, Family::Cauchy] {
        let phi = vector::<B>(&family.default_phi(0.1));
        let of = |[value, slope]: [Tensor<B, 1>; 2]| [numbers(value), numbers(slope)];
        let found = of(ValueOf(family).log_value_and_slope(phi.clone(), vector(&x)));
        let expected = of(family.log_value_and_slope(phi.clone(), vector(&x)));
        let density = numbers(family.density(phi.clone(), vector(&x)));
        let value = numbers(family.value(phi, vector(&x)));
        for k in 0..x.len() {
            assert!((found[0][k] - expected[0][k]).abs() < 1e-5, "{family} at {}", x[k]);
            let slope = density[k] / value[k];
            for found in [found[1][k], expected[1][k]] {
                assert!((found - slope).abs() < 1e-4 * slope, "{family} at {}: {found}", x[k]);
            }
        }
    }
}
