use std::sync::Arc;

use softrast_mesh::{Mesh, MeshError};
use softrast_tensor::{
    AutodiffBackend, Backend, Tensor,
    burn::{
        self,
        module::{Module, Param},
        optim::{GradientsParams, Optimizer},
    },
    numbers,
};

use crate::Surface;

/// A mesh with movable vertices as a module of burn, for burn's own optimisers: its one parameter
/// are the vertices, `[1, vertices, 3]` in world units.
///
/// A start is a sphere around the object, `frame_of_masks(&views)?.mesh_to_world(&icosphere(3))`, or the visual hull of the masks. For a mesh
/// of unit size, Adam at 0.01 and a weight of 0.01 for [`laplacian`](Self::laplacian) are a beginning.
///
/// ```
/// use softrast_inverse::VertexModel;
/// use softrast_mesh::{Mesh, icosphere};
/// use softrast_tensor::{Autodiff, NdArray, burn::optim::AdamConfig};
///
/// type B = Autodiff<NdArray>;
/// let mut shape = VertexModel::<B>::new(&icosphere(1), &Default::default());
/// let mut adam = AdamConfig::new().init();
/// let loss = shape.vertices().powi_scalar(2).mean() + shape.surface().flatness(shape.vertices()) * 1e-3;
/// shape = shape.step(&mut adam, 0.01, loss);
/// let size = |mesh: &Mesh| mesh.positions().iter().flatten().map(|x| x.abs()).sum::<f64>();
/// assert!(size(&shape.mesh().unwrap()) < size(&icosphere(1)));
/// ```
#[derive(Module, Debug)]
pub struct VertexModel<B: Backend> {
    vertices: Param<Tensor<B, 3>>,
    surface: Surface<B>,
    #[module(skip)]
    mesh: Arc<Mesh>,
}

impl<B: Backend> VertexModel<B> {
    /// A model with the vertices of the mesh.
    pub fn new(mesh: &Mesh, device: &B::Device) -> Self {
        Self {
            vertices: Param::from_tensor(softrast_raster::vertex_tensor(mesh.positions(), device)),
            surface: Surface::new(mesh, device),
            mesh: Arc::new(mesh.clone()),
        }
    }

    /// The vertices `[1, vertices, 3]`, as [`project`](softrast_raster::project) takes them. They are the parameter itself, so
    /// `vertices.grad(&loss.backward())` is the gradient with respect to them.
    pub fn vertices(&self) -> Tensor<B, 3> {
        self.vertices.val()
    }

    /// The faces (corners as vertex numbers), as renderers take them.
    pub fn faces(&self) -> &[[u32; 3]] {
        self.mesh.faces()
    }

    /// The losses that keep a surface smooth and its edges even.
    pub fn surface(&self) -> &Surface<B> {
        &self.surface
    }

    /// The [`Surface::laplacian`] of the vertices, `[1]`.
    pub fn laplacian(&self) -> Tensor<B, 1> {
        self.surface.laplacian(self.vertices())
    }

    /// The mesh with its current vertices.
    ///
    /// # Errors
    ///
    /// If a vertex is not finite in 32-bit floats.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let positions = numbers(self.vertices());
        self.mesh.with_positions(positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
    }
}

impl<B: AutodiffBackend> VertexModel<B> {
    /// The model after a step of a burn optimiser along the gradient of a `loss` `[1]`.
    ///
    /// It is equivalent to this in a loop of burn:
    ///
    /// ```
    /// # use softrast_inverse::VertexModel;
    /// # use softrast_mesh::icosphere;
    /// # use softrast_tensor::{Autodiff, NdArray, numbers};
    /// use softrast_tensor::burn::optim::{AdamConfig, GradientsParams, Optimizer};
    ///
    /// # let start = VertexModel::<Autodiff<NdArray>>::new(&icosphere(0), &Default::default());
    /// let (shape, mut adam) = (start.clone(), AdamConfig::new().init());
    /// let loss = shape.vertices().powi_scalar(2).mean();
    /// let gradients = GradientsParams::from_grads(loss.backward(), &shape);
    /// let shape = adam.step(0.01, shape, gradients);
    /// # let loss = start.vertices().powi_scalar(2).mean();
    /// # let other = start.step(&mut AdamConfig::new().init(), 0.01, loss);
    /// # assert_eq!(numbers(shape.vertices()), numbers(other.vertices()));
    /// ```
    #[must_use]
    pub fn step(
        self,
        optimizer: &mut impl Optimizer<Self, B>,
        learning_rate: f64,
        loss: Tensor<B, 1>,
    ) -> Self {
        let gradients = GradientsParams::from_grads(loss.backward(), &self);
        optimizer.step(learning_rate, self, gradients)
    }
}
