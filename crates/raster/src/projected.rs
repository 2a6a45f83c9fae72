use softrast_tensor::{AutodiffBackend, Backend, Tensor, numbers};

/// Margin in front of the nearest vertex and behind the farthest, as a fraction of the distance between the depth planes.
const MARGIN: f64 = 0.05;

/// Projected vertices, `[views, vertices, 3]`: x and y in NDC (x right, y up; the shorter side of the image is [-1, 1]) and the camera
/// depth in world units.
///
/// [`project`](crate::project) computes them from world vertices. Renderers accept only this type, so unprojected vertices are a compile
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
