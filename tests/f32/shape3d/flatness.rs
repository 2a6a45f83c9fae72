//! Hinges worked by hand.

use burn::backend::NdArray;
use shape3d::Flatness;
use softrast_mesh::Edges;
use softrast_tests::tensor;

/// The loss of two faces on an edge along x, the second turned up to the point (y, z).
fn loss([y, z]: [f64; 2]) -> f32 {
    let vertices = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3, -1.0, 0.0, 0.6, y, z];
    let flatness = Flatness::<NdArray>::new(&Edges::new(&[[0, 1, 2], [1, 0, 3]]));
    flatness.loss(tensor(&vertices, [4, 3]).transpose()).into_scalar()
}

#[test]
fn flat_is_zero_a_right_angle_one_and_folded_back_four() {
    for (beyond, expected) in [([1.0, 0.0], 0.0), ([0.0, 2.0], 1.0), ([-1.0, 0.0], 4.0)] {
        let found = loss(beyond);
        assert!((found - expected).abs() < 1e-4, "{beyond:?}: {found}");
    }
}

#[test]
fn collapsed_faces_and_no_hinges_are_finite() {
    assert!(loss([0.0, 0.0]).is_finite());
    let none = Flatness::<NdArray>::new(&Edges::new(&[[0, 1, 2]]));
    assert_eq!(none.loss(tensor(&[1.0; 9], [3, 3])).into_scalar(), 0.0);
}
