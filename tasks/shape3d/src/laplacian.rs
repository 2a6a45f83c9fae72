use burn::tensor::{IndexingUpdateOp, Int, Tensor, TensorData, backend::Backend};
use softrast_mesh::Edges;
use softrast_meta::tensor;

/// How far vertices are from the mean of their neighbours.
#[derive(Clone, Debug)]
pub struct Laplacian<B: Backend> {
    /// Both ends of every edge, in both directions: `[3, 2 edges]` each, the same for every axis.
    from: Tensor<B, 2, Int>,
    to: Tensor<B, 2, Int>,
    /// One over the number of neighbours, `[1, vertices]`; 0 without any.
    share: Tensor<B, 2>,
    /// 1 for vertices with neighbours, `[1, vertices]`, else 0.
    used: Tensor<B, 2>,
}

impl<B: Backend> Laplacian<B> {
    /// Of as many `vertices`, joined by these edges.
    pub fn new(edges: &Edges, vertices: usize) -> Self {
        let forth = edges.ends.iter().copied();
        let back = edges.ends.iter().map(|&[a, b]| [b, a]);
        let pairs: Vec<[u32; 2]> = forth.chain(back).collect();
        let mut degree = vec![0.0; vertices];
        for &[from, _] in &pairs {
            degree[from as usize] += 1.0;
        }
        let share = degree.iter().map(|&d| if d > 0.0 { 1.0 / d } else { 0.0 }).collect();
        let used = degree.iter().map(|&d: &f64| d.min(1.0)).collect();
        let ends = |k: usize| indices(pairs.iter().map(|pair| pair[k]));
        Self {
            from: ends(0),
            to: ends(1),
            share: tensor(share, [1, vertices]),
            used: tensor(used, [1, vertices]),
        }
    }

    /// `Σ |v - mean of the neighbours of v|²` of `vertices` `[3, vertices]`, `[1]`.
    ///
    /// A vertex without neighbours, which cannot be seen, does not count. Source: docs/notes.md, Losses and errors.
    pub fn loss(&self, vertices: Tensor<B, 2>) -> Tensor<B, 1> {
        let neighbours = vertices.clone().gather(1, self.to.clone());
        let sums =
            vertices.zeros_like().scatter(1, self.from.clone(), neighbours, IndexingUpdateOp::Add);
        let away = vertices * self.used.clone() - sums * self.share.clone();
        (away.clone() * away).sum()
    }
}

/// Vertex numbers as a tensor `[3, numbers]`, the same for every axis.
///
/// Numbers for each coordinate, with the axes first, are many times faster to gather by on the CPU than rows of three.
pub(crate) fn indices<B: Backend>(numbers: impl Iterator<Item = u32>) -> Tensor<B, 2, Int> {
    let numbers: Vec<i64> = numbers.map(i64::from).collect();
    let shape = [3, numbers.len()];
    Tensor::from_data(TensorData::new(numbers.repeat(3), shape), &Default::default())
}
