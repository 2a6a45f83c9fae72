use burn::tensor::{Int, Tensor, backend::Backend};
use softrast_mesh::Edges;

use crate::laplacian::indices;

/// Added to squared lengths before they divide or a root is taken, in squared world units.
///
/// Hides edges and heights below a thousandth of a unit, and so keeps both derivatives finite
/// where faces collapse. Source: FACTS 4.1.
const EPSILON: f64 = 1e-6;

/// How sharply faces bend at their common edges.
#[derive(Clone, Debug)]
pub(crate) struct Flatness<B: Backend> {
    /// Four vertices of each hinge, all first ones before all second ones: `[4 hinges]`.
    corners: Option<Tensor<B, 1, Int>>,
}

impl<B: Backend> Flatness<B> {
    pub(crate) fn new(edges: &Edges) -> Self {
        let corners = (0..4).flat_map(|k| edges.hinges.iter().map(move |hinge| hinge[k]));
        Self { corners: (!edges.hinges.is_empty()).then(|| indices(corners)) }
    }

    /// `Σ (cos α + 1)²` over all edges between two faces of `vertices` `[vertices, 3]`, `[1]`.
    ///
    /// `α` is the angle between the heights of both faces on their common edge: half a turn where
    /// the surface is flat, so that it adds nothing. Source: FACTS 4.1.
    pub(crate) fn loss(&self, vertices: Tensor<B, 2>) -> Tensor<B, 1> {
        let Some(corners) = &self.corners else { return vertices.sum() * 0.0 };
        let corners = vertices.select(0, corners.clone());
        let [from, to, one, other] = corners.chunk(4, 0).try_into().expect("four equal parts");
        let edge = to - from.clone();
        let inverse = (dot(&edge, &edge) + EPSILON).recip();
        let heights = [one, other].map(|corner| {
            let side = corner - from.clone();
            side.clone() - edge.clone() * (dot(&side, &edge) * inverse.clone())
        });
        let [h1, h2] = &heights;
        let lengths = (dot(h1, h1) + EPSILON) * (dot(h2, h2) + EPSILON);
        let bend = dot(h1, h2) * lengths.sqrt().recip() + 1.0;
        (bend.clone() * bend).sum()
    }
}

/// Row by row, `[rows, 3]` twice to `[rows, 1]`.
fn dot<B: Backend>(a: &Tensor<B, 2>, b: &Tensor<B, 2>) -> Tensor<B, 2> {
    (a.clone() * b.clone()).sum_dim(1)
}

#[cfg(test)]
mod tests {
    use burn::backend::NdArray;
    use softrast_method::tensor;

    use super::*;

    /// The loss of two faces on an edge along x, the second turned up to the point (y, z).
    fn loss([y, z]: [f64; 2]) -> f32 {
        let vertices = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3, -1.0, 0.0, 0.6, y, z];
        let flatness = Flatness::<NdArray>::new(&Edges::new(&[[0, 1, 2], [1, 0, 3]]));
        flatness.loss(tensor(vertices, [4, 3])).into_scalar()
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
        assert_eq!(none.loss(tensor(vec![1.0; 9], [3, 3])).into_scalar(), 0.0);
    }
}
