use softrast_tensor::{AutodiffBackend, Backend, Tensor, numbers, tensor_on};

use crate::{
    RasterBackend,
    backend::{elementary, primitive},
    ops::ElementaryOp,
};

/// Margin in front of the nearest vertex and behind the farthest, as a fraction of the distance between the depth planes.
const MARGIN: f64 = 0.05;

/// Points in world units as a tensor `[1, points, 3]`, in the float type of the backend: mesh vertices, for [`project`].
pub fn vertex_tensor<B: Backend>(positions: &[[f64; 3]], device: &B::Device) -> Tensor<B, 3> {
    tensor_on(positions.concat(), [1, positions.len(), 3], device)
}

/// Cameras of [`project`], one per view.
///
/// Implemented for orbits `[views, 4]` (distance in world units, then elevation, azimuth and the whole field of view in degrees, as in
/// [`Orbit::tensor`](crate::Orbit::tensor)), for [`Pinholes`](crate::Pinholes), and for custom matrices `[views, 3, 4]`. Gradients reach
/// all of these tensors.
///
/// ```
/// use softrast_raster::{Cameras, HostBackend, RasterBackend, project, vertex_tensor};
/// use softrast_tensor::{Tensor, numbers, tensor};
///
/// /// A camera at the origin that looks along z, with this focal length in NDC.
/// struct Ahead(f64);
///
/// impl<B: RasterBackend> Cameras<B> for Ahead {
///     fn matrices(&self) -> Tensor<B, 3> {
///         tensor(vec![self.0, 0.0, 0.0, 0.0, 0.0, self.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0], [1, 3, 4])
///     }
/// }
/// let point = vertex_tensor::<HostBackend>(&[[0.5, 0.0, 2.0]], &Default::default());
/// assert_eq!(numbers(project(point, Ahead(3.0)).tensor()), [0.75, 0.0, 2.0]);
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` are no cameras on the backend `{B}`",
    note = "`project` takes orbits `[views, 4]`, `Pinholes`, or matrices `[views, 3, 4]`, as tensors of the backend of the vertices"
)]
pub trait Cameras<B: RasterBackend> {
    /// The matrix of each view, `[views, 3, 4]`: two rows give x and y in NDC times the depth, the third gives the depth.
    fn matrices(&self) -> Tensor<B, 3>;
}

impl<B: RasterBackend> Cameras<B> for Tensor<B, 2> {
    fn matrices(&self) -> Tensor<B, 3> {
        let [_, four] = self.dims();
        assert_eq!(four, 4, "orbits must be [views, 4], found {:?}", self.dims());
        elementary(ElementaryOp::OrbitMatrix, vec![primitive(self.clone())])
    }
}

impl<B: RasterBackend> Cameras<B> for Tensor<B, 3> {
    fn matrices(&self) -> Tensor<B, 3> {
        let [_, rows, columns] = self.dims();
        assert_eq!(
            [rows, columns],
            [3, 4],
            "matrices must be [views, 3, 4], found {:?}",
            self.dims()
        );
        self.clone()
    }
}

impl<B: RasterBackend, C: Cameras<B>> Cameras<B> for &C {
    fn matrices(&self) -> Tensor<B, 3> {
        C::matrices(self)
    }
}

/// Perspective projection.
///
/// `vertices` `[views, vertices, 3]` (or `[1, vertices, 3]` for all views) are world coordinates, `cameras` has one camera per view; see
/// [`Cameras`]. The result is `[views, vertices, 3]`.
///
/// Coordinates beyond 1e15 count as 1e15, so that nothing overflows and gradients stay finite. A vertex nearer than [`NEAR`](crate::NEAR)
/// is projected as if at that depth, to avoid division by zero; the rasterizer culls its faces by their depth.
///
/// Source: docs/notes.md, Camera.
///
/// # Panics
///
/// If the shapes do not fit.
pub fn project<B: RasterBackend>(vertices: Tensor<B, 3>, cameras: impl Cameras<B>) -> Projected<B> {
    let matrices = cameras.matrices();
    let ([held, _, three], [views, ..]) = (vertices.dims(), matrices.dims());
    assert!(
        three == 3 && (held == views || held == 1),
        "vertices of {views} views must be [{views}, vertices, 3] or [1, vertices, 3], found {:?}",
        vertices.dims()
    );
    // The rasterizer needs one row per axis, and the transposition back is free.
    let inputs = vec![primitive(vertices), primitive(matrices)];
    Projected::new(elementary::<B, 3>(ElementaryOp::Perspective, inputs).swap_dims(1, 2))
}

/// Projected vertices, `[views, vertices, 3]`: x and y in NDC (x right, y up; the shorter side of the image is [-1, 1]) and the camera
/// depth in world units.
///
/// [`project`] computes them from world vertices. Renderers accept only this type, so unprojected vertices are a compile
/// error:
///
/// ```compile_fail
/// use softrast_tensor::NdArray;
/// use softrast_raster::{SoftRenderer, vertex_tensor};
/// use softrast_softness::Family;
///
/// let world = vertex_tensor::<NdArray>(&[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &Default::default());
/// SoftRenderer::new(&[[0, 1, 2]], 32, Family::Logistic, 0.01).silhouette(world);
/// ```
#[derive(Clone, Debug)]
pub struct Projected<B: Backend>(Tensor<B, 3>);

impl<B: Backend> Projected<B> {
    /// Vertices projected by a custom camera model, `[views, vertices, 3]`, as described [above](Projected).
    ///
    /// # Panics
    ///
    /// If the last axis does not have length 3.
    pub fn new(vertices: Tensor<B, 3>) -> Self {
        let [_, _, three] = vertices.dims();
        assert_eq!(three, 3, "vertices must be [views, vertices, 3], found {:?}", vertices.dims());
        Self(vertices)
    }

    /// Number of views.
    pub fn views(&self) -> usize {
        self.0.dims()[0]
    }

    /// The vertices `[views, vertices, 3]`.
    pub fn tensor(self) -> Tensor<B, 3> {
        self.0
    }

    /// Depths that enclose all vertices in all views, ascending, with a margin: planes for a [`ColourRenderer`](crate::ColourRenderer). The
    /// nearer one is at least [`NEAR`](crate::NEAR). The depths are read from the device.
    ///
    /// ```
    /// use softrast_tensor::{NdArray, Tensor};
    /// use softrast_raster::Projected;
    ///
    /// let seen = Tensor::<NdArray, 3>::from_floats([[[0.0, 0.0, 2.0], [0.0, 0.5, 3.0], [0.5, 0.0, 4.0]]], &Default::default());
    /// let [near, far] = Projected::new(seen).planes();
    /// assert!((near - 1.9).abs() < 1e-6 && (far - 4.1).abs() < 1e-6);
    /// ```
    ///
    /// # Panics
    ///
    /// If there are no vertices, or the backend cannot be read synchronously.
    pub fn planes(&self) -> [f64; 2] {
        let depths = numbers(self.0.clone().narrow(2, 2, 1));
        assert!(!depths.is_empty(), "planes need vertices to lie around");
        let near = depths.iter().copied().fold(f64::INFINITY, f64::min).max(crate::NEAR);
        let far = depths.iter().copied().fold(near, f64::max);
        // A flat scene needs a margin too.
        let room = MARGIN * (far - near).max(0.1 * near);
        [(near - room).max(crate::NEAR), far + room]
    }
}

impl<B: AutodiffBackend> Projected<B> {
    /// Without gradients.
    pub fn inner(self) -> Projected<B::InnerBackend> {
        Projected(self.0.inner())
    }

    /// As constants of a backend with gradients.
    pub fn from_inner(inner: Projected<B::InnerBackend>) -> Self {
        Self(Tensor::from_inner(inner.0))
    }
}
