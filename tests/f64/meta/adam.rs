//! Steps of Adam computed by hand.

use softrast_meta::{Adam, Optimizer};
use softrast_tensor::NdArray;
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

#[test]
fn first_step_moves_by_the_learning_rate_whatever_the_gradient() {
    let adam = Adam::new(0.5);
    let theta = vector::<B>(&[1.0, 1.0, 1.0]);
    let state = adam.init(&theta);
    let (theta, state) = adam.step(theta, vector(&[3.0, -2e-3, 0.0]), state);
    let moved = numbers(theta);
    let size = |g: f64| 0.5 * g / ((g * g + 1e-16).sqrt() + 1e-8);
    for (theta, expected) in moved.iter().zip([1.0 - size(3.0), 1.0 + size(2e-3), 1.0]) {
        assert!((theta - expected).abs() < 1e-15, "{theta} {expected}");
    }
    assert_eq!(state.step, 1);
}

#[test]
fn state_holds_the_running_means() {
    let adam = Adam { beta1: 0.5, beta2: 0.75, ..Adam::new(0.1) };
    let theta = vector::<B>(&[0.0]);
    let (theta, state) = adam.step(theta.clone(), vector(&[4.0]), adam.init(&theta));
    let (_, state) = adam.step(theta, vector(&[2.0]), state);
    assert_eq!(state.m.into_scalar(), 0.5 * 2.0 + 0.5 * 2.0);
    assert_eq!(state.v.into_scalar(), 0.75 * 4.0 + 0.25 * 4.0);
}
