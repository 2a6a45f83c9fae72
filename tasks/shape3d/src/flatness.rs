use burn::tensor::{Int, Tensor, backend::Backend};
use softrast_mesh::Edges;

use crate::laplacian::indices;

/// Added to squared lengths before they divide or a root is taken, in squared world units.
///
/// Hides edges and heights below a thousandth of a unit, and so keeps both derivatives finite
/// where faces collapse. Source: docs/notes.md, Losses and errors.
const EPSILON: f64 = 1e-6;

/// How sharply faces bend at their common edges.
#[derive(Clone, Debug)]
pub struct Flatness<B: Backend> {
    /// Four vertices of each hinge, all first ones before all second ones: `[3, 4 hinges]`.
    corners: Option<Tensor<B, 2, Int>>,
}

impl<B: Backend> Flatness<B> {
    /// Of the hinges among these edges.
    pub fn new(edges: &Edges) -> Self {
        let corners = (0..4).flat_map(|k| edges.hinges.iter().map(move |hinge| hinge[k]));
        Self { corners: (!edges.hinges.is_empty()).then(|| indices(corners)) }
    }

    /// `Σ (cos α + 1)²` over all edges between two faces of `vertices` `[3, vertices]`, `[1]`.
    ///
    /// `α` is the angle between the heights of both faces on their common edge: half a turn where
    /// the surface is flat, so that it adds nothing. Source: docs/notes.md, Losses and errors.
    #[allow(clippy::missing_panics_doc, reason = "four parts are four parts")]
    pub fn loss(&self, vertices: Tensor<B, 2>) -> Tensor<B, 1> {
        let Some(corners) = &self.corners else { return vertices.sum() * 0.0 };
        let corners = vertices.gather(1, corners.clone());
        let [from, to, one, other] = corners.chunk(4, 1).try_into().expect("four equal parts");
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

/// Column by column, `[3, columns]` twice to `[1, columns]`.
fn dot<B: Backend>(a: &Tensor<B, 2>, b: &Tensor<B, 2>) -> Tensor<B, 2> {
    (a.clone() * b.clone()).sum_dim(0)
}
