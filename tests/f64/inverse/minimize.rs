//! Descents whose positions are all known.

use softrast_inverse::{
    AdaptiveSchedule, InverseProblem, Iterate, Method, ScheduledSoftness, minimize,
};
use softrast_meta::{Adam, Optimizer};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::NdArray;
use softrast_tests::{numbers, vector};

use super::square::Square;

type B = NdArray<f64>;

const START: [f64; 2] = [4.0, -8.0];

fn iterates(
    problem: &Square,
    instances: &[f64],
    mut visit: impl FnMut(&Iterate) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let softness = EdgeSoftness::new(Family::Logistic);
    let method = Method::new("none", ScheduledSoftness::constant(softness, 0.1));
    let config = problem.defaults();
    minimize::<_, B>(problem, instances, &method, &config, |iterate, _| visit(iterate))?;
    Ok(())
}

/// Positions of Adam on `θ²`.
fn expected(floor: f64) -> Vec<Vec<f64>> {
    let adam = Adam::new(0.25);
    let mut theta = vector::<B>(&START);
    let mut state = adam.init(&theta);
    let mut places = vec![numbers(theta.clone())];
    for _ in 0..3 {
        let gradient = theta.clone() * 2.0;
        let (moved, next) = adam.step(theta, gradient, state);
        (theta, state) = (moved.clamp_min(floor), next);
        places.push(numbers(theta.clone()));
    }
    places
}

fn assert_goes_as_expected(floor: f64) -> Vec<Vec<f64>> {
    let mut places = Vec::new();
    let visit = |now: &Iterate| {
        assert_eq!((now.step, now.step > 0), (places.len(), now.seconds.is_some()));
        let theta = numbers(now.theta.clone());
        let squares: Vec<f64> = theta.iter().map(|x| x * x).collect();
        assert_eq!([&now.loss, &now.soft_loss], [&squares; 2]);
        let rounded: Vec<f64> = theta.iter().map(|x| x.round() * x.round()).collect();
        assert_eq!(now.hard_loss, rounded);
        assert!(now.image.is_none());
        places.push(theta);
        Ok(())
    };
    iterates(&Square { floor, seen: true }, &START, visit).unwrap();
    assert_eq!(places, expected(floor));
    places
}

#[test]
fn every_place_from_the_start_to_the_end_is_seen_once() {
    let places = assert_goes_as_expected(-10.0);
    // The first step of Adam has the length of the learning rate.
    assert_eq!((places.len(), &places[0]), (4, &START.to_vec()));
    assert!((places[1][0] - 3.75).abs() < 1e-6 && (places[1][1] + 7.75).abs() < 1e-6);
}

#[test]
fn a_step_ends_where_it_is_allowed_to() {
    let places = assert_goes_as_expected(3.6);
    assert_eq!((places[1][1], places[3][0]), (3.6, 3.6));
}

#[test]
fn a_rate_falls_geometrically_to_its_end() {
    let softness = EdgeSoftness::new(Family::Logistic);
    let constant = ScheduledSoftness::constant(softness, 0.1);
    let method = Method::new("none", ScheduledSoftness { rate_end: Some(0.01), ..constant });
    let problem = Square { floor: -1e9, seen: true };
    let mut places = Vec::new();
    // So far away that all gradients are alike and steps of Adam have the length of its rate.
    minimize::<_, B>(&problem, &[1e6], &method, &problem.defaults(), |now, _| {
        places.push(numbers(now.theta.clone())[0]);
        Ok(())
    })
    .unwrap();
    let steps: Vec<f64> = places.windows(2).map(|pair| pair[0] - pair[1]).collect();
    for (step, expected) in steps.iter().zip([0.25, 0.025, 0.0025]) {
        assert!((step / expected - 1.0).abs() < 1e-4, "{steps:?}");
    }
}

#[test]
fn parameters_without_a_gradient_stay_and_an_error_ends_the_descent() {
    let mut seen = 0;
    let visit = |now: &Iterate| {
        assert_eq!(numbers(now.theta.clone()), [7.0]);
        seen += 1;
        anyhow::ensure!(seen < 3, "enough");
        Ok(())
    };
    let end = iterates(&Square { floor: 0.0, seen: false }, &[7.0], visit);
    assert_eq!(end.unwrap_err().to_string(), "enough");
    assert_eq!(seen, 3);
}

#[test]
fn nothing_to_solve_is_an_error() {
    let end = iterates(&Square { floor: 0.0, seen: true }, &[], |_| Ok(()));
    assert_eq!(end.unwrap_err().to_string(), "there is no instance to solve");
}

/// A moving scale with an adaptive schedule of one step.
fn adaptive() -> Method {
    let softness = EdgeSoftness::new(Family::Logistic);
    let adaptive = AdaptiveSchedule {
        steps: 3,
        duration: 0.0,
        patience: 0.0,
        stall_threshold: 0.0,
        stall_slope: 0.0,
        reserve: -1.0,
        rate_end: 0.0,
    };
    let decay = ScheduledSoftness::decay(softness, 0.1, 0.01);
    Method::new("none", ScheduledSoftness { adaptive: Some(adaptive), ..decay })
}

#[test]
fn a_stalled_run_restarts_from_another_start_if_there_is_one() {
    let problem = Square { floor: -10.0, seen: true };
    let (method, config) = (adaptive(), problem.defaults());
    for (start, second) in [(Square::MANY, Square::OTHER), (7.0, 6.75)] {
        let (mut places, mut scales) = (Vec::new(), Vec::new());
        let mut visit = |now: &Iterate| {
            places.push(numbers(now.theta.clone())[0]);
            scales.push(now.scale);
            Ok(())
        };
        minimize::<_, B>(&problem, &[start], &method, &config, |now, _| visit(now)).unwrap();
        assert!((places[1] - second).abs() < 1e-6 && places[0] == start, "{places:?}");
        // The first step of a restarted Adam has the length of the learning rate.
        assert!((places[1] - places[2] - 0.25).abs() < 1e-6, "{places:?}");
        for (scale, expected) in scales.iter().zip([0.1, 0.1, 0.01]) {
            assert!((scale / expected - 1.0).abs() < 1e-9, "{scales:?}");
        }
    }
}

#[test]
fn runs_with_an_adaptive_schedule_are_solved_one_at_a_time() {
    let problem = Square { floor: 0.0, seen: true };
    let (method, config) = (adaptive(), problem.defaults());
    let end = minimize::<_, B>(&problem, &START, &method, &config, |_, _| Ok(()));
    assert!(end.unwrap_err().to_string().contains("one instance at a time, found 2"));
}
