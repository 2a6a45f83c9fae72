//! Schedules of the scale.

use softrast_inverse::{ScaleSchedule, ScheduledSoftness};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::NdArray;
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

#[test]
fn a_schedule_joins_its_knots_above_the_floor() {
    let knots = vector::<B>(&[0.0, 2.0, 1.0]);
    for (progress, expected) in [(0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (0.75, 1.5), (1.0, 1.0)] {
        let scale: f64 = ScaleSchedule::scale(&knots, 0.5, progress).into_scalar();
        assert!((scale - 0.5 - f64::exp(expected)).abs() < 1e-12, "{progress}: {scale}");
    }
    let alone: f64 = ScaleSchedule::scale(&vector::<B>(&[1.0]), 0.0, 0.7).into_scalar();
    assert!((alone - f64::exp(1.0)).abs() < 1e-12);
}

fn gauss(squared: bool) -> EdgeSoftness {
    let edge = if squared { EdgeSoftness::squared } else { EdgeSoftness::new };
    edge(Family::Gauss)
}

#[track_caller]
fn assert_near(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 1e-12, "{found}, not {expected}");
}

#[test]
fn a_decay_is_geometric_and_its_surrogate_keeps_the_ratio() {
    for squared in [false, true] {
        let decay = ScheduledSoftness::decay(gauss(squared), 0.1, 0.001).with_surrogate_scale(0.3);
        for (progress, expected) in [(0.0, 0.1), (0.5, 0.01), (1.0, 0.001)] {
            assert_near(decay.scale_at(progress, 64), expected);
            assert_near(decay.phi_at(progress, 64)[0].exp(), expected);
            let width = if squared { f64::sqrt(expected) } else { expected };
            assert_near(decay.width_at(progress, 64), width);
            let surrogate = decay.surrogate_at(progress, 64).unwrap();
            assert_near(surrogate.phi[0].exp(), 3.0 * expected);
        }
        assert!(!decay.is_constant());
        // Two knots, and one parameter of the surrogate.
        assert_eq!(decay.parameters(), 3);
    }
}

#[test]
fn a_softness_without_a_schedule_stays() {
    let constant = ScheduledSoftness::constant(gauss(false), 0.02).with_surrogate_scale(0.1);
    for progress in [0.0, 0.7, 1.0] {
        assert_near(constant.scale_at(progress, 64), 0.02);
        assert_near(constant.width_at(progress, 64), 0.02);
        assert_eq!(constant.phi_at(progress, 64), [0.02_f64.ln()]);
        assert_eq!(constant.surrogate_at(progress, 64).unwrap().phi, [0.1_f64.ln()]);
    }
    assert!(constant.is_constant());
    assert_eq!(constant.parameters(), 2);
    let still = ScheduledSoftness::decay(gauss(false), 0.02, 0.02);
    assert!(still.is_constant());
    assert_near(still.scale_at(0.3, 64), 0.02);
    assert_eq!(ScheduledSoftness::decay(gauss(false), 0.1, 0.01).surrogate_at(0.0, 8), None);
}

#[test]
fn a_schedule_multiplies_the_scale_of_the_parameters_above_a_floor_in_pixels() {
    let schedule = ScaleSchedule { knots: vec![-2.0, -5.0, -6.0], floor_px: 0.5 };
    let network = EdgeSoftness::new(Family::Mlp);
    for softness in [gauss(false), gauss(true), network] {
        let floor: f64 = if softness.scale_is_squared() { 1.0 / 4096.0 } else { 1.0 / 64.0 };
        let phi = softness.default_phi(2.0);
        let base = ScheduledSoftness::constant(softness, 2.0);
        let moving = ScheduledSoftness { schedule: Some(schedule.clone()), ..base };
        for (progress, knot) in [(0.0, -2.0), (0.25, -3.5), (1.0, -6.0)] {
            let scale = f64::exp(knot) + floor;
            assert_near(moving.scale_at(progress, 64), scale);
            let tensor = ScaleSchedule::scale(&vector::<B>(&schedule.knots), floor, progress);
            assert_eq!(numbers(tensor), [moving.scale_at(progress, 64)]);
            assert_eq!(moving.phi_at(progress, 64), softness.with_scale_values(&phi, scale));
            let width =
                if softness.scale_is_squared() { (2.0 * scale).sqrt() } else { 2.0 * scale };
            assert_near(moving.width_at(progress, 64), width);
        }
        // The knots replace a family's scale; a network has none.
        let expected = if softness == network { 56 + 3 } else { 3 };
        assert_eq!(moving.parameters(), expected);
    }
}

#[test]
fn the_softness_learned_for_poses_narrows() {
    let learned = ScheduledSoftness::learned("pose").unwrap();
    let widths = [0.0, 0.5, 1.0].map(|progress| learned.width_at(progress, 64));
    assert!(widths.windows(2).all(|pair| pair[1] < pair[0]), "{widths:?}");
    assert_eq!(learned.task.as_deref(), Some("pose"));
}
