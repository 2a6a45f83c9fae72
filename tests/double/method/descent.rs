//! Descents whose every place is known.

use burn::{
    backend::{Autodiff, NdArray},
    tensor::Tensor,
};
use softrast_meta::Sgd;
use softrast_method::{Descent, Moment};
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

/// Places of a descent in `θ²` of two parameters that may not fall below `floor`.
fn places(start: [f64; 2], floor: f64) -> Vec<Vec<f64>> {
    let descent = Descent { optimizer: Sgd { learning_rate: 0.25 }, steps: 2 };
    let mut places = Vec::new();
    let square = |step, theta: Tensor<Autodiff<B>, 1>| (theta.clone() * theta, step);
    let visit = |now: Moment<B, 1, usize>| {
        assert_eq!((now.step, now.step > 0), (now.seen, now.seconds.is_some()));
        let squares = numbers(now.theta.clone() * now.theta.clone());
        assert_eq!(numbers(now.loss), squares);
        places.push(numbers(now.theta));
        Ok(())
    };
    let start = vector::<B>(&start);
    descent.run(start, square, |theta| theta.clamp_min(floor), visit).unwrap();
    places
}

#[test]
fn every_place_from_the_start_to_the_end_is_seen_once() {
    let expected = [[4.0, -8.0], [2.0, -4.0], [1.0, -2.0]];
    assert_eq!(places([4.0, -8.0], -10.0), expected);
}

#[test]
fn a_step_ends_where_it_is_allowed_to() {
    assert_eq!(places([4.0, 8.0], 3.0), [[4.0, 8.0], [3.0, 4.0], [3.0, 3.0]]);
}

#[test]
fn parameters_without_a_gradient_stay_and_an_error_ends_the_descent() {
    let descent = Descent { optimizer: Sgd { learning_rate: 1.0 }, steps: 5 };
    let mut seen = 0;
    let constant = |_, theta: Tensor<Autodiff<B>, 1>| (theta.detach(), ());
    let visit = |now: Moment<B, 1, ()>| {
        assert_eq!(numbers(now.theta), [7.0]);
        seen += 1;
        anyhow::ensure!(seen < 3, "enough");
        Ok(())
    };
    let end = descent.run(vector::<B>(&[7.0]), constant, |theta| theta, visit);
    assert_eq!(end.unwrap_err().to_string(), "enough");
    assert_eq!(seen, 3);
}
