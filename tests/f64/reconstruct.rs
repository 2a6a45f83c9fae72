//! Convolutions as products of matrices compared with those of burn.

use reconstruct::{convolution, convolved};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, tensor};

type B = NdArray<f64>;
type A = Autodiff<B>;

/// A convolution, and its gradients with respect to pictures and weights.
fn results(
    convolve: impl Fn(Tensor<A, 4>) -> Tensor<A, 4>,
    of: [Tensor<A, 4>; 2],
) -> [Vec<f64>; 3] {
    let [pictures, weight] = of;
    let seen = convolve(pictures.clone());
    let count = seen.shape().num_elements();
    let factors: Vec<f64> = (0..count).map(|k| (1.3 * k as f64).sin()).collect();
    let grads = (seen.clone() * tensor(&factors, seen.dims())).sum().backward();
    [
        numbers(seen.inner()),
        numbers(pictures.grad(&grads).unwrap()),
        numbers(weight.grad(&grads).unwrap()),
    ]
}

#[test]
fn a_product_of_matrices_is_the_convolution_and_has_its_gradients() {
    let layer = convolution::<A>([3, 4], &Default::default());
    let shape = [2, 3, 8, 12];
    let values: Vec<f64> =
        (0..shape.iter().product()).map(|k: usize| (0.7 * k as f64).cos()).collect();
    let of = || [tensor(&values, shape).require_grad(), layer.weight.val()];
    let found = results(|pictures| convolved(&layer, pictures), of());
    let expected = results(|pictures| layer.forward(pictures), of());
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} and {expected}");
        }
    }
}
