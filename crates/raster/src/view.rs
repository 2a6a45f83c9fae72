//! The rotations of orbiting cameras.

use std::f64::consts::PI;

use softrast_tensor::{Backend, Tensor};

use crate::RasterBackend;

/// Rotation from world to camera axes for cameras that look at the origin with y up.
///
/// `elevation` and `azimuth` are `[views]` in degrees; the result is `[views, 3, 3]` with rows x (left), y (up) and z (ahead), as in
/// PyTorch3D. Both angles 0 give the identity: the camera is at -z and looks along +z.
///
/// Past the pole (|elevation| > 90°) the view rolls by 180°, as in `look_at`. At the pole itself, where `look_at` divides by zero, the axes
/// are those just before it.
///
/// ```
/// use softrast_raster::{HostBackend, view_rotation};
/// use softrast_tensor::{numbers, vector};
///
/// let still = view_rotation(vector::<HostBackend>(&[0.0]), vector(&[0.0]));
/// assert_eq!(numbers(still), [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
/// ```
///
/// Source: docs/notes.md, Camera, with the cross products of `look_at` multiplied out.
pub fn view_rotation<B: RasterBackend>(
    elevation: Tensor<B, 1>,
    azimuth: Tensor<B, 1>,
) -> Tensor<B, 3> {
    // Sign of the up direction: constant on either side of the pole, so it has no gradient. In f32 the cosine at a pole has any sign.
    let past = elevation.clone().detach() + 90.0;
    let past = past.clone() - (past * (1.0 / 360.0)).floor() * 360.0;
    let roll = past.clone().ones_like().mask_fill(past.clone().greater_elem(180.0), -1.0);
    let roll = roll.mask_fill(past.greater_equal_elem(360.0), 1.0);
    let [sin_e, cos_e] = sin_cos(radians(elevation));
    let [sin_a, cos_a] = sin_cos(radians(azimuth));
    let zero = cos_a.clone() * 0.0;
    let rows = vec![
        cos_a.clone() * roll.clone(),
        zero,
        sin_a.clone() * roll.clone(),
        (sin_e.clone() * sin_a.clone() * roll.clone()).neg(),
        cos_e.clone() * roll.clone(),
        sin_e.clone() * cos_a.clone() * roll,
        (cos_e.clone() * sin_a).neg(),
        sin_e.neg(),
        cos_e * cos_a,
    ];
    let views = rows[0].dims()[0];
    Tensor::stack::<2>(rows, 1).reshape([views, 3, 3])
}

/// Distance of the image plane in NDC, `[views, 1, 1]`.
pub(crate) fn focal<B: RasterBackend>(fov_deg: Tensor<B, 1>) -> Tensor<B, 3> {
    let [views] = fov_deg.dims();
    let [sin, cos] = sin_cos(radians(fov_deg * 0.5));
    (cos / sin).reshape([views, 1, 1])
}

fn radians<B: Backend>(degrees: Tensor<B, 1>) -> Tensor<B, 1> {
    // One factor: burn 0.21 differentiates a division by a number in f32.
    degrees * (PI / 180.0)
}

/// Sine and cosine of angles in radians.
pub(crate) fn sin_cos<B: RasterBackend, const D: usize>(
    radians: Tensor<B, D>,
) -> [Tensor<B, D>; 2] {
    match B::ON_HOST {
        true => [radians.clone().sin(), radians.cos()],
        false => by_series(radians),
    }
}

/// Sine and cosine by sums and products only: the built-in functions of a GPU may be off by 2^-11 (WebGPU Shading Language, Accuracy of
/// Built-in Functions), which is visible in a loss.
fn by_series<B: Backend, const D: usize>(radians: Tensor<B, D>) -> [Tensor<B, D>; 2] {
    let turns = radians * (0.5 / PI);
    // Half the remaining angle, within a right angle, where the next terms are below 1e-8.
    let half = (turns.clone() - turns.round()) * PI;
    let square = half.clone() * half.clone();
    let sum = |last: usize| {
        let term = |sum: Tensor<B, D>, k: usize| {
            (sum * square.clone()) * (-1.0 / (k * (k - 1)) as f64) + 1.0
        };
        (2..last).rev().step_by(2).fold(square.ones_like(), term)
    };
    let (sin, cos) = (half * sum(14), sum(13));
    let versine = sin.clone() * sin.clone() * 2.0;
    [sin * cos * 2.0, versine.neg() + 1.0]
}

#[cfg(all(test, any(feature = "ndarray", feature = "gpu")))]
mod tests {
    use softrast_tensor::{Autodiff, NdArray, numbers, vector};

    use super::*;

    /// Rounding of the angle, which is at most 10, and of some sums in f32.
    const ROUNDED: f64 = 2e-6;

    #[test]
    fn a_series_is_sine_and_cosine_with_their_derivatives() {
        let angles: Vec<f64> = (-1000..=1000).map(|k| f64::from(k) * 0.01).collect();
        for k in 0..2 {
            let radians = vector::<Autodiff<NdArray<f32>>>(&angles).require_grad();
            let found = by_series(radians.clone())[k].clone();
            let slope = radians.grad(&found.clone().sum().backward()).expect("a gradient");
            for ((x, y), slope) in angles.iter().zip(numbers(found)).zip(numbers(slope)) {
                let (sin, cos) = x.sin_cos();
                let (value, derivative) = if k == 0 { (sin, cos) } else { (cos, -sin) };
                assert!((y - value).abs() < ROUNDED, "{y} at {x}, expected {value}");
                assert!((slope - derivative).abs() < ROUNDED, "slope {slope} at {x}");
            }
        }
    }
}
