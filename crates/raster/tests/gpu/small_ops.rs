//! Cameras and losses on the GPU in f32 against f64 on the CPU: values, gradients, second order.

use softrast_raster::{RasterBackend, TConorm, iou_loss, mse_loss, project};
use softrast_tensor::{Autodiff, NdArray, Tensor, vector};

use super::{
    adapter,
    products::{numbers, relative},
};
use crate::Gpu;

/// Largest error of values and derivatives, relative to their length.
const BOUND: f64 = 2e-5;

const VIEWS: usize = 3;
const POINTS: usize = 300;
/// Compared by more than one cube.
const SIDES: [usize; 2] = [100, 103];

/// A function of a vector.
#[derive(Clone, Copy, Debug)]
enum Of {
    /// Numbers of point sets projected by three cameras.
    Projection(usize),
    Coverage,
    /// Losses of images and targets, with their numbers.
    Iou(usize, usize),
    Mse(usize, usize),
}

fn wave(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|k| (step * k as f64 + 0.3).sin()).collect()
}

impl Of {
    fn inputs(self) -> Vec<f64> {
        let pixels = SIDES[0] * SIDES[1];
        let shares = |count: usize| wave(count * pixels, 0.37).into_iter().map(|x| x * x).collect();
        match self {
            Self::Projection(sets) => {
                let mut x = wave(3 * sets * POINTS, 0.9);
                // Behind the camera, nearer than the least divisor, and too far away.
                (x[2], x[5], x[10], x[20]) = (-9.0, -2.95, 1e16, -1e300);
                x.extend([3.0, 20.0, 130.0, 50.0, 2.0, -100.0, 30.0, 80.0, 5.0, 89.0, -10.0, 10.0]);
                x
            }
            Self::Coverage => shares(2),
            Self::Iou(one, other) | Self::Mse(one, other) => shares(one + other),
        }
    }

    fn run<T: RasterBackend>(self, x: Tensor<T, 1>) -> Tensor<T, 1> {
        let pixels = SIDES[0] * SIDES[1];
        let images = |first: usize, count: usize| {
            let flat = x.clone().narrow(0, first * pixels, count * pixels);
            flat.reshape([count, SIDES[0], SIDES[1]])
        };
        match self {
            Self::Projection(sets) => {
                let coordinates = 3 * sets * POINTS;
                let points = x.clone().narrow(0, 0, coordinates).reshape([sets, POINTS, 3]);
                let orbits = x.clone().narrow(0, coordinates, 4 * VIEWS).reshape([VIEWS, 4]);
                // Far coordinates would dominate all others.
                project(points, orbits).tensor().flatten(0, 2).clamp(-1e3, 1e3)
            }
            Self::Coverage => TConorm::Probabilistic.coverage(images(0, 2)).flatten(0, 2),
            Self::Iou(one, other) => iou_loss(images(0, one), images(one, other)),
            Self::Mse(one, other) => mse_loss(images(0, one), images(one, other)),
        }
    }

    /// Values, the gradient of a weighted sum of their squares, and that of a weighted sum of the gradient.
    fn orders<T: RasterBackend>(self) -> [Vec<f64>; 3] {
        let inner = vector::<Autodiff<T>>(&self.inputs()).require_grad();
        let outer = Tensor::<Autodiff<Autodiff<T>>, 1>::from_inner(inner.clone()).require_grad();
        let value = self.run(outer.clone());
        let [count] = value.dims();
        let loss = (value.clone() * value.clone() * vector(&wave(count, 0.7))).sum();
        let gradient = outer.grad(&loss.backward()).expect("a gradient");
        let [count] = gradient.dims();
        let again = (gradient.clone() * vector(&wave(count, 1.3))).sum().backward();
        let second = inner.grad(&again).expect("a second order");
        [numbers(value), numbers(gradient), numbers(second)]
    }
}

#[test]
fn cameras_at_the_poles_are_turned_as_on_the_cpu() {
    if !adapter() {
        return;
    }
    fn seen<T: RasterBackend>(elevations: &[f64]) -> Vec<f64> {
        let orbits: Vec<f64> = elevations.iter().flat_map(|&e| [3.0, e, 40.0, 60.0]).collect();
        let orbits = vector::<T>(&orbits).reshape([elevations.len(), 4]);
        numbers(project(vector::<T>(&[0.3, 0.2, 0.1]).reshape([1, 1, 3]), orbits).tensor())
    }
    let elevations = [90.0, -90.0, 270.0, 450.0, 91.0, -91.0, 89.0, 269.0];
    let (exact, cpu) = (seen::<NdArray<f64>>(&elevations), seen::<NdArray<f32>>(&elevations));
    for (k, (a, b)) in seen::<Gpu>(&elevations).iter().zip(exact.iter().zip(cpu)).enumerate() {
        let near = |x: f64| (a - x).abs() < 1e-5;
        assert!(near(*b.0) && near(b.1), "{}: {a}, {b:?}", elevations[k / 3]);
    }
}

#[test]
fn cameras_and_losses_agree_with_the_cpu_in_f64_to_second_order() {
    if !adapter() {
        return;
    }
    let projections = [Of::Projection(1), Of::Projection(VIEWS)];
    let losses = [Of::Iou(2, 2), Of::Iou(2, 1), Of::Mse(2, 2), Of::Mse(1, 2)];
    for of in projections.into_iter().chain(losses).chain([Of::Coverage]) {
        let expected = of.orders::<NdArray<f64>>();
        let found = of.orders::<Gpu>();
        let errors: Vec<f64> = found
            .iter()
            .zip(&expected)
            .map(|(found, expected)| relative(found, expected))
            .collect();
        let shown: Vec<String> = errors.iter().map(|error| format!("{error:.1e}")).collect();
        println!("{of:?}: {}", shown.join(", "));
        assert!(errors.iter().all(|&error| error <= BOUND), "{of:?}: relative errors {shown:?}");
    }
}
