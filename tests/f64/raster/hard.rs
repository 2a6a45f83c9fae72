//! The nearest face at a pixel.

use softrast_raster::{Projected, hard_coverage, hard_silhouette, nearest_faces};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::{numbers, tensor, vector};

use super::triangles::triangles;

#[test]
fn of_faces_that_cut_one_another_each_is_seen_where_it_is_nearer() {
    // A flat one at depth 2, and one whose depth goes from 1 at x = -1 to 4 at x = 1: 1 / depth is 1/2 at x = 1/3.
    let vertices = [
        [-9.0, -9.0, 2.0],
        [9.0, -9.0, 2.0],
        [0.0, 9.0, 2.0],
        [-1.0, -1.0, 1.0],
        [1.0, -1.0, 4.0],
        [1.0, 1.0, 4.0],
        [-1.0, 1.0, 1.0],
    ];
    let vertices = tensor::<NdArray<f64>, 3>(vertices.as_flattened(), [1, vertices.len(), 3]);
    let faces = [[0, 1, 2], [3, 4, 5], [3, 5, 6]];
    let both = Tensor::cat(vec![vertices.clone(), vertices + 50.0], 0);
    let seen = nearest_faces(Projected::new(both), &faces, 6);
    let (row, away) = (&seen[12..18], &seen[36..]);
    assert_eq!(row[..2], [Some(2); 2], "above the diagonal");
    assert_eq!(row[4..], [Some(0); 2]);
    assert!(row[2..4].iter().all(|face| matches!(face, Some(1 | 2))), "{row:?}");
    assert_eq!(away, [None; 36]);
}

#[test]
fn of_equally_near_faces_the_first_is_seen_and_flat_ones_never() {
    let vertices =
        [[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [0.0, 9.0, 2.0], [0.0, 9.0, 1.0], [0.0, -9.0, 1.0]];
    let vertices = tensor::<NdArray<f64>, 3>(vertices.as_flattened(), [1, vertices.len(), 3]);
    let faces = [[3, 4, 4], [2, 1, 0], [0, 1, 2]];
    assert_eq!(nearest_faces(Projected::new(vertices), &faces, 3), [Some(1); 9]);
}

#[test]
fn hard_coverage_is_the_mean_of_a_finer_silhouette() {
    let (vertices, faces) = triangles(9, 15);
    let vertices = vector::<NdArray<f64>>(&vertices).reshape([1, vertices.len() as i64 / 3, 3]);
    let vertices = Projected::new(vertices);
    let fine = hard_silhouette(vertices.clone(), &faces, [24, 36]);
    let means = fine.reshape([8, 3, 12, 3]).mean_dim(3).mean_dim(1).reshape([96]);
    let found = numbers(hard_coverage(vertices, &faces, [8, 12], 3));
    assert!(found.iter().zip(numbers(means)).all(|(a, b)| (a - b).abs() < 1e-6));
    assert!(found.iter().any(|&x| x > 0.0 && x < 1.0));
}
