use softrast_mesh::{Edges, Mesh};
use softrast_raster::{edge_length, flatness, normal_consistency};
use softrast_tensor::{
    Backend, IndexingUpdateOp, Int, Tensor, TensorData,
    burn::{self, module::Module},
    tensor_on,
};

/// The connectivity of a surface, for losses that keep it smooth. Each loss takes `vertices` `[1, vertices, 3]` in
/// world units, as [`project`](softrast_raster::project) does, and returns `[1]`; other shapes panic.
///
/// ```
/// use softrast_tensor::NdArray;
/// use softrast_inverse::Surface;
/// use softrast_mesh::icosphere;
///
/// let sphere = icosphere(1);
/// let surface = Surface::<NdArray>::new(&sphere, &Default::default());
/// let vertices = softrast_raster::vertex_tensor(sphere.positions(), &Default::default());
/// let bend = surface.normal_consistency(vertices.clone()).into_scalar();
/// assert!((0.0..0.2).contains(&bend));
/// let stretched = surface.edge_length(vertices, 0.5).into_scalar();
/// assert!(stretched < 0.1);
/// ```
#[derive(Module, Debug)]
pub struct Surface<B: Backend> {
    /// Both ends of every edge, in both directions: `[3, 2 edges]` each, the same for every axis.
    from: Tensor<B, 2, Int>,
    to: Tensor<B, 2, Int>,
    /// Both ends of every edge, all first ones before all second ones: `[3, 2 edges]`.
    ends: Option<Tensor<B, 2, Int>>,
    /// Four vertices of each hinge, all first ones before all second ones: `[3, 4 hinges]`.
    hinges: Option<Tensor<B, 2, Int>>,
    /// One over the number of neighbours, `[1, vertices]`; 0 without any.
    share: Tensor<B, 2>,
    /// 1 for vertices with neighbours, `[1, vertices]`, else 0.
    used: Tensor<B, 2>,
}

impl<B: Backend> Surface<B> {
    /// The surface of a mesh.
    pub fn new(mesh: &Mesh, device: &B::Device) -> Self {
        Self::of_edges(&Edges::new(mesh.faces()), mesh.positions().len(), device)
    }

    /// The surface of this many `vertices`, joined by these edges.
    pub fn of_edges(edges: &Edges, vertices: usize, device: &B::Device) -> Self {
        let forth = edges.ends.iter().copied();
        let back = edges.ends.iter().map(|&[a, b]| [b, a]);
        let pairs: Vec<[u32; 2]> = forth.chain(back).collect();
        let mut degree = vec![0.0; vertices];
        for &[from, _] in &pairs {
            degree[from as usize] += 1.0;
        }
        let share = degree.iter().map(|&d| if d > 0.0 { 1.0 / d } else { 0.0 }).collect();
        let used = degree.iter().map(|&d: &f64| d.min(1.0)).collect();
        let of_pairs = |k: usize| indices(pairs.iter().map(|pair| pair[k]), device);
        let ends = (0..2).flat_map(|k| edges.ends.iter().map(move |ends| ends[k]));
        let hinges = (0..4).flat_map(|k| edges.hinges.iter().map(move |hinge| hinge[k]));
        Self {
            from: of_pairs(0),
            to: of_pairs(1),
            ends: (!edges.ends.is_empty()).then(|| indices(ends, device)),
            hinges: (!edges.hinges.is_empty()).then(|| indices(hinges, device)),
            share: tensor_on(share, [1, vertices], device),
            used: tensor_on(used, [1, vertices], device),
        }
    }

    /// `Σ |v - mean of the neighbours of v|²`.
    ///
    /// Vertices without neighbours, which are invisible, do not count. Source: docs/notes.md, Losses and errors.
    pub fn laplacian(&self, vertices: Tensor<B, 3>) -> Tensor<B, 1> {
        let vertices = by_axis(vertices);
        let neighbours = vertices.clone().gather(1, self.to.clone());
        let sums =
            vertices.zeros_like().scatter(1, self.from.clone(), neighbours, IndexingUpdateOp::Add);
        let away = vertices * self.used.clone() - sums * self.share.clone();
        (away.clone() * away).sum()
    }

    /// [`flatness`]; 0 if no two faces share an edge.
    pub fn flatness(&self, vertices: Tensor<B, 3>) -> Tensor<B, 1> {
        gathered(vertices, self.hinges.as_ref(), flatness)
    }

    /// [`normal_consistency`]; 0 if no two faces share an edge.
    pub fn normal_consistency(&self, vertices: Tensor<B, 3>) -> Tensor<B, 1> {
        gathered(vertices, self.hinges.as_ref(), normal_consistency)
    }

    /// [`edge_length`] around this `length` in world units; 0 without edges.
    pub fn edge_length(&self, vertices: Tensor<B, 3>, length: f64) -> Tensor<B, 1> {
        gathered(vertices, self.ends.as_ref(), |ends| edge_length(ends, length))
    }
}

/// `[3, vertices]`: on the CPU, many times faster to gather than rows of three.
fn by_axis<B: Backend>(vertices: Tensor<B, 3>) -> Tensor<B, 2> {
    let [sets, _, three] = vertices.dims();
    assert!(
        sets == 1 && three == 3,
        "a surface has vertices [1, vertices, 3], found {:?}",
        vertices.dims()
    );
    vertices.squeeze_dim::<2>(0).transpose()
}

/// The loss of the gathered vertices; 0 if there are none.
fn gathered<B: Backend>(
    vertices: Tensor<B, 3>,
    numbers: Option<&Tensor<B, 2, Int>>,
    loss: impl Fn(Tensor<B, 3>) -> Tensor<B, 1>,
) -> Tensor<B, 1> {
    match numbers {
        Some(numbers) => loss(by_axis(vertices).gather(1, numbers.clone()).unsqueeze()),
        None => vertices.sum() * 0.0,
    }
}

/// Vertex numbers as a tensor `[3, numbers]`, the same for every axis.
fn indices<B: Backend>(
    numbers: impl Iterator<Item = u32>,
    device: &B::Device,
) -> Tensor<B, 2, Int> {
    let numbers: Vec<i64> = numbers.map(i64::from).collect();
    let shape = [3, numbers.len()];
    Tensor::from_data(TensorData::new(numbers.repeat(3), shape), device)
}
