use burn::tensor::{Int, Tensor, backend::Backend};
use softrast_mesh::Edges;
use softrast_raster::flatness;

use crate::laplacian::indices;

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

    /// [`flatness`] of `vertices` `[3, vertices]`, `[1]`; 0 where no two faces share an edge.
    pub fn loss(&self, vertices: Tensor<B, 2>) -> Tensor<B, 1> {
        let Some(corners) = &self.corners else { return vertices.sum() * 0.0 };
        flatness(vertices.gather(1, corners.clone()).unsqueeze())
    }
}
