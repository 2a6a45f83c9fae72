use burn::tensor::{Element, Int, Tensor, TensorData, backend::Backend};
use softrast_mesh::Edges;

/// Weights of the two terms. Source: docs/notes.md, Reconstruction.
const LAPLACIAN: f64 = 5e-3;
const FLATNESS: f64 = 5e-4;

/// Added to squared lengths before they divide or a root is taken, in squared world units; hides edges
/// and heights below a thousandth of a unit. Source: docs/notes.md, Losses and errors.
const EPSILON: f64 = 1e-6;

/// What keeps the surfaces of many shapes with the same closed topology smooth.
#[derive(Clone, Debug)]
pub struct Smoothness<B: Backend> {
    /// Column v tells how far vertex v is from the mean of its neighbours, `[vertices, vertices]`. A
    /// dense product costs less than gathering neighbours where there are many shapes.
    away: Tensor<B, 2>,
    /// Four vertices of each hinge, all first ones before all second ones: `[4 hinges]`.
    corners: Tensor<B, 1, Int>,
}

impl<B: Backend> Smoothness<B> {
    /// For shapes with these faces and so many vertices.
    ///
    /// # Panics
    ///
    /// If no two faces share an edge.
    pub fn new(faces: &[[u32; 3]], vertices: usize, device: &B::Device) -> Self {
        let edges = Edges::new(faces);
        assert!(!edges.hinges.is_empty(), "a surface needs faces that share an edge");
        let mut neighbours = vec![Vec::new(); vertices];
        for [a, b] in edges.ends.iter().map(|ends| ends.map(|v| v as usize)) {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        let mut away = vec![0.0; vertices * vertices];
        for (v, near) in neighbours.iter().enumerate().filter(|(_, near)| !near.is_empty()) {
            away[v * vertices + v] = 1.0;
            for &other in near {
                away[other * vertices + v] = -1.0 / near.len() as f64;
            }
        }
        let corners = (0..4).flat_map(|k| edges.hinges.iter().map(move |h| i64::from(h[k])));
        let corners: Vec<i64> = corners.collect();
        let count = corners.len();
        let dtype = <B::FloatElem as Element>::dtype();
        Self {
            away: Tensor::from_data(TensorData::new(away, [vertices; 2]), (device, dtype)),
            corners: Tensor::from_data(TensorData::new(corners, [count]), device),
        }
    }

    /// Mean over the shapes of 0.005 `Σ |v - mean of the neighbours of v|²` and 0.0005 `Σ (cos α + 1)²`,
    /// `[1]`, of `vertices` `[shapes, 3, vertices]`.
    ///
    /// The first sum is over the vertices; the second over the edges between two faces, whose heights
    /// on the edge enclose α: half a turn where the surface is flat. Source: docs/notes.md, Losses and errors.
    pub fn loss(&self, vertices: Tensor<B, 3>) -> Tensor<B, 1> {
        let [shapes, _, count] = vertices.dims();
        let rows = vertices.reshape([3 * shapes, count]);
        let away = rows.clone().matmul(self.away.clone());
        let laplacian = (away.clone() * away).sum();
        let flatness = self.bends(rows, shapes);
        (laplacian * LAPLACIAN + flatness * FLATNESS) * (shapes as f64).recip()
    }

    fn bends(&self, rows: Tensor<B, 2>, shapes: usize) -> Tensor<B, 1> {
        let [count] = self.corners.dims();
        let corners = rows.select(1, self.corners.clone()).reshape([shapes, 3, count]);
        let [from, to, one, other] = corners.chunk(4, 2).try_into().expect("four equal parts");
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

/// Of the vectors along the middle axis: `[shapes, 3, n]` twice to `[shapes, 1, n]`.
fn dot<B: Backend>(a: &Tensor<B, 3>, b: &Tensor<B, 3>) -> Tensor<B, 3> {
    (a.clone() * b.clone()).sum_dim(1)
}
