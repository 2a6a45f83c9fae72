//! Cameras compared with one built by `look_at` on the origin.

use proptest::prelude::*;
use softrast_raster::{NEAR, project, view_rotation};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::numbers;

type B = NdArray<f64>;

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    a.map(|x| x / dot(a, a).sqrt())
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// x and y in NDC and the depth of one vertex, with the camera built by `look_at`.
fn view_square(vertex: [f64; 3], [distance, elevation, azimuth, fov]: [f64; 4]) -> [f64; 3] {
    let [e, a, half] = [elevation, azimuth, fov / 2.0].map(f64::to_radians);
    let eye = [e.cos() * a.sin(), e.sin(), -e.cos() * a.cos()].map(|x| distance * x);
    let z = unit(eye.map(|x| -x));
    let x = unit(cross(z, [0.0, 1.0, 0.0]));
    let y = cross(x, z);
    let from = [0, 1, 2].map(|k| vertex[k] - eye[k]);
    let depth = dot(z, from);
    let divisor = depth.max(NEAR) * half.tan();
    [dot(x, from) / divisor, dot(y, from) / divisor, depth]
}

fn projected(vertex: [f64; 3], orbit: [f64; 4]) -> Vec<f64> {
    let device = Default::default();
    let vertices = Tensor::<B, 1>::from_data(vertex, &device).reshape([1, 1, 3]);
    numbers(project(vertices, Tensor::<B, 1>::from_data(orbit, &device).reshape([1, 4])).tensor())
}

#[test]
fn a_camera_without_angles_looks_along_z() {
    let found = projected([0.5, -1.0, 1.0], [3.0, 0.0, 0.0, 90.0]);
    for (found, expected) in found.into_iter().zip([-0.125, -0.25, 4.0]) {
        assert!((found - expected).abs() < 1e-15, "{found}, not {expected}");
    }
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(256))]

    #[test]
    fn projection_is_that_of_a_camera_that_looks_at_the_origin(
        vertex in [-2.0..2.0, -2.0..2.0, -2.0..2.0],
        distance in 0.1..10.0,
        elevation in -269.0..269.0,
        azimuth in -400.0..400.0,
        fov in 2.0..160.0,
    ) {
        // At the poles `look_at` is undefined, and next to them it has no digits.
        prop_assume!(f64::cos(f64::to_radians(elevation)).abs() > 1e-2);
        let orbit = [distance, elevation, azimuth, fov];
        let expected = view_square(vertex, orbit);
        for (found, expected) in projected(vertex, orbit).into_iter().zip(expected) {
            prop_assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()));
        }
    }

    #[test]
    fn rotations_keep_lengths_and_handedness(elevation in -400.0..400.0, azimuth in -400.0..400.0) {
        let angle = |x: f64| Tensor::<B, 1>::from_data([x], &Default::default());
        let r = numbers(view_rotation(angle(elevation), angle(azimuth)));
        let row = |k: usize| [r[3 * k], r[3 * k + 1], r[3 * k + 2]];
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j { 1.0 } else { 0.0 };
                prop_assert!((dot(row(i), row(j)) - expected).abs() < 1e-12);
            }
        }
        prop_assert!((dot(cross(row(0), row(1)), row(2)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn no_vertex_gives_a_number_that_is_not_finite(
        vertex in [-1e6..1e6, -1e6..1e6, -1e6..1e6],
        elevation in prop_oneof![Just(90.0), Just(-90.0), -180.0..180.0],
    ) {
        let found = projected(vertex, [0.0, elevation, 0.0, 60.0]);
        prop_assert!(found.iter().all(|x| x.is_finite()));
    }
}
