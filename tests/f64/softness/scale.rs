//! Parameters at another scale.

use softrast_softness::{EdgeSoftness, Family, Softness, families::Mlp, initial_mlp};
use softrast_tensor::NdArray;
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

#[test]
fn a_scaled_softness_is_seen_at_the_distance_in_scales() {
    let x = vector::<B>(&[-0.3, -0.02, 0.1]);
    for family in Family::ALL {
        for squared in [false, true] {
            let softness =
                if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
            let phi = vector(&softness.default_phi(1.0));
            let wide = softness.with_scale(phi.clone(), vector(&[0.09]));
            let found = softness.value(wide, x.clone());
            let divisor: f64 = if squared { 0.3 } else { 0.09 };
            let expected = softness.value(phi, x.clone() * divisor.recip());
            let off: f64 = (found - expected).abs().max().into_scalar();
            assert!(off < 1e-12, "{softness:?}: {off}");
        }
    }
}

#[test]
fn plain_numbers_are_scaled_as_tensors_are_to_the_last_bit() {
    for family in Family::ALL {
        let phi = family.default_phi(0.3);
        let wide = numbers(family.with_scale(vector::<B>(&phi), vector(&[0.09])));
        assert_eq!(family.with_scale_values(&phi, 0.09), wide, "{family}");
    }
}

#[test]
fn the_scale_of_parameters_is_what_they_were_made_for() {
    for family in Family::ALL {
        for scale in [1e-4, 0.02, 3.0] {
            let phi = family.default_phi(scale);
            for (phi, expected) in
                [(phi.clone(), scale), (family.with_scale_values(&phi, 0.3), 0.3 * scale)]
            {
                let found = family.scale(&phi);
                assert!((found / expected - 1.0).abs() < 1e-12, "{family}: {found}");
            }
        }
    }
}

#[test]
fn a_network_has_the_scale_of_a_logistic_with_its_slope() {
    let weights: Vec<f64> = initial_mlp(5, 0.1).iter().map(|w| (7.0 * w).sin()).collect();
    let slope = numbers(Mlp.density(vector::<B>(&weights), vector(&[0.0])))[0];
    assert!((Mlp.scale(&weights) * 4.0 * slope.abs() - 1.0).abs() < 1e-13);
    assert_eq!(Mlp.scale(&[0.0; 56]), 2.5e11);
}
