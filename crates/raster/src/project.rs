use softrast_tensor::Tensor;

use crate::{
    Projected, RasterBackend,
    backend::{elementary, primitive},
    ops::ElementaryOp,
};

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
