use softrast_mesh::{Mesh, MeshError};
use softrast_tensor::{
    Backend, Tensor,
    burn::{
        self,
        module::{Module, Param},
    },
    numbers,
};

/// The vertices of a mesh as a module of burn, for burn's own optimisers: they are its one parameter, `[1, vertices, 3]` in world units.
///
/// ```
/// use softrast_inverse::VertexModel;
/// use softrast_mesh::{Mesh, icosphere};
/// use softrast_tensor::{
///     Autodiff, NdArray,
///     burn::optim::{AdamConfig, GradientsParams, Optimizer},
/// };
///
/// type B = Autodiff<NdArray>;
/// let mesh = icosphere(1);
/// let mut shape = VertexModel::<B>::new(&mesh, &Default::default());
/// let mut adam = AdamConfig::new().init();
/// let loss = shape.vertices().powi_scalar(2).mean();
/// let gradients = GradientsParams::from_grads(loss.backward(), &shape);
/// shape = adam.step(0.01, shape, gradients);
/// let smaller = shape.mesh(&mesh).unwrap();
/// let size = |mesh: &Mesh| mesh.positions().iter().flatten().map(|x| x.abs()).sum::<f64>();
/// assert!(size(&smaller) < size(&mesh));
/// ```
#[derive(Module, Debug)]
pub struct VertexModel<B: Backend> {
    vertices: Param<Tensor<B, 3>>,
}

impl<B: Backend> VertexModel<B> {
    /// The vertices where they are in the mesh.
    pub fn new(mesh: &Mesh, device: &B::Device) -> Self {
        Self { vertices: Param::from_tensor(softrast_raster::vertices(mesh.positions(), device)) }
    }

    /// The vertices `[1, vertices, 3]`, as [`project`](softrast_raster::project) takes them.
    pub fn vertices(&self) -> Tensor<B, 3> {
        self.vertices.val()
    }

    /// The mesh with its vertices where they are now.
    ///
    /// # Errors
    ///
    /// If a vertex is not finite in 32-bit floats.
    ///
    /// # Panics
    ///
    /// If the mesh has another number of vertices.
    pub fn mesh(&self, of: &Mesh) -> Result<Mesh, MeshError> {
        let positions = numbers(self.vertices());
        of.with_positions(positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
    }
}
