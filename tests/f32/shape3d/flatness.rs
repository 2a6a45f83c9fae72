//! Hinges computed by hand.

use softrast_inverse::Surface;
use softrast_mesh::Edges;
use softrast_tensor::NdArray;
use softrast_tests::tensor;

/// Flatness and normal consistency of two faces on an edge along x, the second bent up to the point (y, z).
fn losses([y, z]: [f64; 2]) -> [f32; 2] {
    let vertices = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3, -1.0, 0.0, 0.6, y, z];
    let surface =
        Surface::<NdArray>::of_edges(&Edges::new(&[[0, 1, 2], [1, 0, 3]]), 4, &Default::default());
    let vertices = tensor(&vertices, [1, 4, 3]);
    [surface.flatness(vertices.clone()), surface.normal_consistency(vertices)]
        .map(|loss| loss.into_scalar())
}

#[test]
fn flat_is_zero_a_right_angle_one_and_folded_back_four_or_two() {
    let cases = [([1.0, 0.0], [0.0, 0.0]), ([0.0, 2.0], [1.0, 1.0]), ([-1.0, 0.0], [4.0, 2.0])];
    for (beyond, expected) in cases {
        let found = losses(beyond);
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-4, "{beyond:?}: {found:?}");
    }
}

#[test]
fn lengths_are_those_of_all_edges() {
    let corners = [0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 4.0, 0.0];
    let surface = Surface::<NdArray>::of_edges(&Edges::new(&[[0, 1, 2]]), 3, &Default::default());
    let loss = surface.edge_length(tensor(&corners, [1, 3, 3]), 2.0).into_scalar();
    assert!((loss - (1.0 + 4.0 + 9.0) / 3.0).abs() < 1e-4, "{loss}");
}

#[test]
fn collapsed_faces_and_no_hinges_are_finite() {
    assert!(losses([0.0, 0.0]).iter().all(|loss| loss.is_finite()));
    let none = Surface::<NdArray>::of_edges(&Edges::new(&[[0, 1, 2]]), 3, &Default::default());
    assert_eq!(none.flatness(tensor(&[1.0; 9], [1, 3, 3])).into_scalar(), 0.0);
    let nothing = Surface::<NdArray>::of_edges(&Edges::new(&[]), 3, &Default::default());
    assert_eq!(nothing.edge_length(tensor(&[1.0; 9], [1, 3, 3]), 1.0).into_scalar(), 0.0);
}
