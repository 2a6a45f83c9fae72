//! The small ops of a step, one op each, compared with tensor ops: values, gradients, second order.

use softrast_raster::{iou_loss, mse_loss, project, reference};
use softrast_tensor::{Autodiff, NdArray, Tensor, numbers, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

/// A function of a vector.
type Of = fn(Tensor<AA, 1>) -> Tensor<AA, 1>;

fn wave(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|k| (step * k as f64 + 0.3).sin()).collect()
}

/// Value, gradient of a weighted sum of it, and gradient of a weighted sum of that.
fn orders(of: Of, x: &[f64]) -> [Vec<f64>; 3] {
    let inner = vector::<A>(x).require_grad();
    let outer = Tensor::<AA, 1>::from_inner(inner.clone()).require_grad();
    let value = of(outer.clone());
    let [count] = value.dims();
    let loss = (value.clone() * value.clone() * vector::<AA>(&wave(count, 0.7))).sum();
    let gradient = outer.grad(&loss.backward()).expect("a gradient");
    let again = (gradient.clone() * vector::<A>(&wave(x.len(), 1.3))).sum().backward();
    let second = inner.grad(&again).expect("a second order");
    [numbers(value.inner().inner()), numbers(gradient.inner()), numbers(second)]
}

fn assert_same(fused: Of, dense: Of, x: &[f64]) {
    let order = ["value", "gradient", "second order"];
    for ((fused, dense), order) in orders(fused, x).iter().zip(&orders(dense, x)).zip(order) {
        assert!(dense.iter().any(|&x| x != 0.0), "{order} is nothing");
        let most = dense.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        for (k, (fused, dense)) in fused.iter().zip(dense).enumerate() {
            let off = (fused - dense).abs();
            assert!(off <= 1e-12 * most, "{order} {k}: {fused} instead of {dense}");
        }
    }
}

const VIEWS: usize = 3;
const VERTICES: usize = 300;

/// Vertices of one mesh or one per view, some of them behind the camera or too far away, and orbits that pass a pole.
fn scene(meshes: usize) -> Vec<f64> {
    let mut x = wave(3 * meshes * VERTICES, 0.9);
    (x[2], x[5], x[10], x[20]) = (-9.0, -2.95, 1e16, -1e300);
    x.extend([3.0, 20.0, 130.0, 50.0, 2.0, -100.0, 30.0, 80.0, 5.0, 90.0, -10.0, 10.0]);
    x
}

/// Vertices and orbits of a vector of [`scene`].
fn parts(x: Tensor<AA, 1>) -> (Tensor<AA, 3>, Tensor<AA, 2>) {
    let coordinates = x.dims()[0] - 4 * VIEWS;
    let vertices = x.clone().narrow(0, 0, coordinates).reshape([-1, VERTICES as i32, 3]);
    (vertices, x.narrow(0, coordinates, 4 * VIEWS).reshape([VIEWS, 4]))
}

fn projected(x: Tensor<AA, 1>) -> Tensor<AA, 1> {
    let (vertices, orbits) = parts(x);
    project(vertices, orbits).tensor().flatten(0, 2)
}

#[test]
fn projection_is_that_of_tensor_ops() {
    // Far coordinates would dominate all others.
    let near: Of = |x| projected(x).clamp(-1e3, 1e3);
    let near_dense: Of = |x| {
        let (vertices, orbits) = parts(x);
        let seen = reference::perspective(vertices, reference::orbit_matrices(orbits));
        seen.flatten::<1>(0, 2).clamp(-1e3, 1e3)
    };
    for meshes in [1, VIEWS] {
        assert_same(near, near_dense, &scene(meshes));
        let finite = orders(projected, &scene(meshes)).concat();
        assert!(finite.iter().all(|x| x.is_finite()));
    }
}

/// Two images per view.
fn images(x: Tensor<AA, 1>) -> [Tensor<AA, 3>; 2] {
    let length = x.dims()[0] / 2;
    let image = |k: usize| x.clone().narrow(0, k * length, length).reshape([2, 100, -1]);
    [image(0), image(1)]
}

/// More pixels than one task takes, in [0, 1].
fn pixels() -> Vec<f64> {
    wave(2 * 2 * 100 * 103, 0.37).into_iter().map(|x| x * x).collect()
}

/// Images of two views, and one target for both.
fn with_one_target(x: Tensor<AA, 1>) -> [Tensor<AA, 3>; 2] {
    let length = x.dims()[0] / 3;
    let images = x.clone().narrow(0, 0, 2 * length).reshape([2, 100, -1]);
    [images, x.narrow(0, 2 * length, length).reshape([1, 100, -1])]
}

#[test]
fn one_target_is_compared_with_all_views() {
    let pixels = &pixels()[..3 * 100 * 103];
    assert_same(
        |x| {
            let [image, target] = with_one_target(x);
            iou_loss(image, target)
        },
        |x| {
            let [image, target] = with_one_target(x);
            reference::iou_loss(image, target)
        },
        pixels,
    );
    // And in the other order.
    assert_same(
        |x| {
            let [image, target] = with_one_target(x);
            mse_loss(target, image)
        },
        |x| {
            let [image, target] = with_one_target(x);
            reference::mse_loss(target, image)
        },
        pixels,
    );
}

#[test]
fn losses_are_those_of_tensor_ops() {
    let pairs: [[Of; 2]; 2] = [
        [
            |x| {
                let [image, target] = images(x);
                iou_loss(image, target)
            },
            |x| {
                let [image, target] = images(x);
                reference::iou_loss(image, target)
            },
        ],
        [
            |x| {
                let [image, target] = images(x);
                mse_loss(image, target)
            },
            |x| {
                let [image, target] = images(x);
                reference::mse_loss(image, target)
            },
        ],
    ];
    for [fused, dense] in pairs {
        assert_same(fused, dense, &pixels());
    }
}

#[test]
fn one_target_serves_all_views() {
    let [image, target] = [[3, 4, 5], [1, 4, 5]].map(|shape: [usize; 3]| {
        let waves: Vec<f64> = wave(shape.iter().product(), 0.9).iter().map(|x| x * x).collect();
        vector::<B>(&waves).reshape(shape)
    });
    let all = target.clone().expand([3, 4, 5]);
    for loss in [iou_loss::<B>, mse_loss::<B, 3>] {
        let found = numbers(loss(image.clone(), target.clone()));
        assert_eq!(found, numbers(loss(image.clone(), all.clone())));
        assert_eq!(found.len(), 3);
    }
}
