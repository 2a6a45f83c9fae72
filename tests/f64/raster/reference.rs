//! Signed distances of the reference, by hand and compared with many points of the boundary.

use proptest::prelude::*;
use softrast_raster::reference::signed_distance;
use softrast_tensor::NdArray;
use softrast_tests::{numbers, tensor};

type B = NdArray<f64>;
type Point = [f64; 2];

/// Distances from points to one triangle.
fn distances(corners: [Point; 3], points: &[Point]) -> Vec<f64> {
    let vertices: Vec<f64> = corners.iter().flat_map(|&[x, y]| [x, y, 1.0]).collect();
    let vertices = tensor::<B, 3>(&vertices, [1, 3, 3]);
    let pixels = tensor(&points.concat(), [points.len(), 2]);
    numbers(signed_distance(vertices, &[[0, 1, 2]], pixels))
}

/// The nearest of many points of the boundary, and half the largest gap between two of them.
fn sampled([a, b, c]: [Point; 3], [x, y]: Point) -> (f64, f64) {
    const STEPS: u32 = 2000;
    let mut best = f64::MAX;
    let mut gap: f64 = 0.0;
    for ([ax, ay], [bx, by]) in [(a, b), (b, c), (c, a)] {
        gap = gap.max((bx - ax).hypot(by - ay) / f64::from(STEPS) / 2.0);
        for k in 0..=STEPS {
            let t = f64::from(k) / f64::from(STEPS);
            best = best.min((ax + t * (bx - ax) - x).hypot(ay + t * (by - ay) - y));
        }
    }
    (best, gap)
}

/// Whether a point lies in a triangle, by its barycentric coordinates.
fn contains([[ax, ay], [bx, by], [cx, cy]]: [Point; 3], [x, y]: Point) -> bool {
    let area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    let u = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area;
    let v = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area;
    u > 0.0 && v > 0.0 && u + v < 1.0
}

fn point() -> impl Strategy<Value = Point> {
    [-2.0..2.0, -2.0..2.0]
}

#[test]
fn distances_worked_by_hand() {
    let triangle = [[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]];
    let points = [[1.0, 1.0], [2.0, -0.5], [-3.0, -4.0], [4.0, 3.0], [2.0, 0.0]];
    let expected = [1.0, -0.5, -5.0, -2.4, 0.0];
    for (found, expected) in distances(triangle, &points).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found}, not {expected}");
    }
}

#[test]
fn a_triangle_without_area_has_no_inside() {
    let line = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
    assert_eq!(distances(line, &[[1.0, 0.0]]), [-f64::sqrt(0.5)]);
    assert_eq!(distances([[1.0, 1.0]; 3], &[[1.0, 3.0]]), [-2.0]);
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(256))]

    #[test]
    fn the_distance_is_that_to_the_nearest_point_of_the_boundary(
        corners in [point(), point(), point()],
        at in point(),
    ) {
        let found = distances(corners, &[at])[0].abs();
        let (nearest, gap) = sampled(corners, at);
        prop_assert!(found <= nearest + 1e-12 && nearest <= found.hypot(gap) + 1e-12);
    }

    #[test]
    fn the_sign_says_whether_the_point_is_inside(
        corners in [point(), point(), point()],
        at in point(),
    ) {
        let found = distances(corners, &[at])[0];
        prop_assume!(found.abs() > 1e-9);
        prop_assert_eq!(found > 0.0, contains(corners, at));
    }

    #[test]
    fn corners_in_any_order_have_the_same_distance(
        [a, b, c] in [point(), point(), point()],
        at in point(),
    ) {
        let expected = distances([a, b, c], &[at])[0];
        for corners in [[b, c, a], [c, a, b], [c, b, a], [a, c, b]] {
            prop_assert!((distances(corners, &[at])[0] - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn no_two_points_differ_by_more_than_they_are_apart(
        corners in [point(), point(), point()],
        from in point(),
        to in point(),
    ) {
        let found = distances(corners, &[from, to]);
        let apart = (from[0] - to[0]).hypot(from[1] - to[1]);
        prop_assert!((found[0] - found[1]).abs() <= apart + 1e-12);
    }
}
