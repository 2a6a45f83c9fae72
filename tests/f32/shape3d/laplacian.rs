//! A triangle computed by hand.

use softrast_inverse::Surface;
use softrast_mesh::Edges;
use softrast_tensor::NdArray;
use softrast_tests::tensor;

fn loss(faces: &[[u32; 3]], vertices: &[[f64; 3]]) -> f32 {
    let surface =
        Surface::<NdArray>::of_edges(&Edges::new(faces), vertices.len(), &Default::default());
    surface.laplacian(tensor(&vertices.concat(), [1, vertices.len(), 3])).into_scalar()
}

#[test]
fn each_corner_of_a_triangle_is_compared_with_the_middle_of_the_others() {
    // The Laplacian of a corner is one and a half times its distance from the centroid.
    let corners = [[2.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]];
    assert!((loss(&[[0, 1, 2]], &corners) - 2.25 * 8.0).abs() < 1e-5);
}

#[test]
fn moving_everything_changes_nothing_and_unused_vertices_do_not_count() {
    let corners = [[2.0, 5.0, 1.0], [-1.0, 6.0, 1.0], [-1.0, 4.0, 1.0], [9.0, 9.0, 9.0]];
    assert!((loss(&[[0, 1, 2]], &corners) - 2.25 * 8.0).abs() < 1e-4);
}
