mod knots;
mod losses;

use std::sync::Arc;

use softrast_softness::Softness;
use softrast_tensor::{Backend, Element, Tensor, tensor_on};

use self::knots::Knots;
pub(crate) use self::knots::stretch;
use crate::{
    HostBackend, ImageSize, Projected, RasterBackend, Rasterizer, Silhouette, TConorm, Width,
    cache::Cache, hard::hard_coverage_of,
};

/// Draws soft silhouettes of one mesh topology.
///
/// It holds everything that an image depends on except the vertices: faces, size, softness, T-conorm and tolerance. Support and knots adapt
/// to the parameters φ, so the error of a pixel is at most the tolerance in exact arithmetic for any parameters. If no table can meet the
/// tolerance, [`error_bound`](Self::error_bound) is larger and states the remaining error. If only the scale of the softness changes, they
/// are stretched at no cost; if its shape changes, they are chosen anew, which takes milliseconds.
///
/// ```
/// use softrast_tensor::{Autodiff, NdArray};
/// use softrast_raster::{Orbit, SoftRenderer, project, vertex_tensor};
/// use softrast_softness::Family;
///
/// let device = Default::default();
/// let corners = vertex_tensor::<Autodiff<NdArray>>(&[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &device);
/// let camera = Orbit { distance: 3.0, elevation_deg: 0.0, azimuth_deg: 20.0, fov_deg: 60.0 }.tensor(&device).require_grad();
/// let renderer = SoftRenderer::new(&[[0, 1, 2]], 32, Family::Logistic, 0.01);
/// let alpha = renderer.silhouette(project(corners, camera.clone())); // [1, 32, 32]
/// let gradient = camera.grad(&alpha.mean().backward()).unwrap(); // [1, 4]
/// # assert_eq!(gradient.dims(), [1, 4]);
/// ```
#[derive(Clone, Debug)]
pub struct SoftRenderer<S> {
    rasterizer: Rasterizer,
    faces: Arc<[[u32; 3]]>,
    /// Number of faces that knots are chosen for: at least the number of faces.
    room: usize,
    softness: S,
    phi: Vec<f64>,
    surrogate: Option<Box<Self>>,
    /// Samples along each side of a pixel, if the image is hard.
    samples: Option<usize>,
    cache: Cache<Knots<S>>,
}

impl<S: Softness> SoftRenderer<S> {
    /// Draws meshes with these `faces` (corners as vertex numbers) on images of `size` pixels, a square or `[height, width]`, with a
    /// softness of this [`Width`] (a number is its scale), the probabilistic sum and [`Rasterizer::TOLERANCE`]. See [`reach`](Self::reach)
    /// for a softness with heavy tails.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, or the width is not positive.
    pub fn new(
        faces: &[[u32; 3]],
        size: impl Into<ImageSize>,
        softness: S,
        width: impl Into<Width>,
    ) -> Self {
        let rasterizer = Rasterizer::new(size);
        let phi = width.into().phi(&softness, rasterizer.size);
        Self::with_rasterizer(rasterizer, faces.into(), softness, phi)
    }

    /// A renderer from a [`Rasterizer`]; `phi` `[parameters]` are the parameters of the softness.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, or `phi` has the wrong length.
    pub fn with_rasterizer(
        rasterizer: Rasterizer,
        faces: Arc<[[u32; 3]]>,
        softness: S,
        phi: Vec<f64>,
    ) -> Self {
        assert!(rasterizer.size.pixels() > 0, "an image needs at least one pixel");
        assert!(!faces.is_empty(), "a silhouette needs at least one face");
        check(&softness, &phi);
        let (room, cache) = (faces.len(), Cache::default());
        Self { rasterizer, faces, room, softness, phi, surrogate: None, samples: None, cache }
    }

    /// This renderer for other faces. Knots and tables are reused unless there are many more faces than before, so a change of topology
    /// during an optimisation costs only the new list of faces.
    ///
    /// ```
    /// use softrast_tensor::NdArray;
    /// use softrast_raster::{Projected, SoftRenderer, vertex_tensor};
    /// use softrast_softness::Family;
    ///
    /// let corners = [[-0.5, -0.5, 2.0], [0.5, -0.5, 2.0], [0.5, 0.5, 2.0], [-0.5, 0.5, 2.0]];
    /// let corners = vertex_tensor::<NdArray>(&corners, &Default::default());
    /// let one = SoftRenderer::new(&[[0, 1, 2]], 32, Family::Gauss, 0.01);
    /// let two = one.with_faces([[0, 1, 2], [0, 2, 3]]);
    /// let [half, whole] = [one, two].map(|r| r.silhouette(Projected::new(corners.clone())).mean().into_scalar());
    /// assert!((whole / half - 2.0).abs() < 0.1);
    /// ```
    ///
    /// # Panics
    ///
    /// If there are no faces.
    #[must_use]
    pub fn with_faces(&self, faces: impl Into<Arc<[[u32; 3]]>>) -> Self {
        let faces: Arc<[[u32; 3]]> = faces.into();
        assert!(!faces.is_empty(), "a silhouette needs at least one face");
        let served = |knots: &Knots<S>| {
            let serves = knots.room >= faces.len();
            serves.then(|| Knots {
                silhouette: knots.silhouette.with_faces(faces.clone()),
                ..knots.clone()
            })
        };
        let surrogate =
            self.surrogate.as_ref().map(|wide| Box::new(wide.with_faces(faces.clone())));
        let (room, cache) = (faces.len().next_power_of_two(), self.cache.continued(served));
        Self { faces, room, surrogate, cache, ..self.clone() }
    }

    /// Culls back faces: those whose corners appear clockwise to the camera. For closed meshes whose faces are counter-clockwise from
    /// outside: their back faces take half of the time and widen the outline, which both sides cover softly.
    ///
    /// The image is that of the front faces only. It jumps where a face turns, by the coverage of the face there.
    #[must_use]
    pub fn without_back_faces(self) -> Self {
        self.changed(|rasterizer| rasterizer.culls = true)
    }

    /// Sets the largest error of a pixel, in (0, 1); see [`Profile::new`](crate::low_level::Profile::new).
    ///
    /// Drawing panics if `tolerance` is not in (0, 1).
    #[must_use]
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        self.changed(|rasterizer| rasterizer.tolerance = tolerance)
    }

    /// Sets the T-conorm that aggregates the coverages of several faces.
    #[must_use]
    pub fn with_t_conorm(self, t_conorm: TConorm) -> Self {
        self.changed(|rasterizer| rasterizer.t_conorm = t_conorm)
    }

    /// Uses hard coverage of `samples` × `samples` points per pixel as the forward image, and soft coverage for gradients:
    /// `soft + (hard - soft)`, with the bracket as a constant.
    ///
    /// Soft coverage of a mesh is slightly too wide at its outline, and too low where faces are narrower than the soft edge. A mesh fitted
    /// to it ends up too small; a mesh fitted with this option does not. Not in the paper. Source: docs/notes.md, Surrogate gradient.
    ///
    /// # Panics
    ///
    /// If `samples` is 0.
    #[must_use]
    pub fn with_hard_image(mut self, samples: usize) -> Self {
        assert!(samples > 0, "hard coverage takes a sample");
        self.samples = Some(samples);
        self
    }

    /// Sets a surrogate softness for the backward pass, of this [`Width`]: a sharp image with the gradient of a wider softness. The
    /// gradient is not the derivative of the image; see [`Silhouette::coverage_with_surrogate`].
    ///
    /// # Panics
    ///
    /// If the width is not positive.
    #[must_use]
    pub fn with_surrogate(self, softness: S, width: impl Into<Width>) -> Self {
        let phi = width.into().phi(&softness, self.rasterizer.size);
        self.with_surrogate_phi(softness, phi)
    }

    /// Sets a surrogate with parameters `phi` `[parameters]`; see [`with_surrogate`](Self::with_surrogate).
    ///
    /// # Panics
    ///
    /// If `phi` has the wrong length.
    #[must_use]
    pub fn with_surrogate_phi(mut self, softness: S, phi: Vec<f64>) -> Self {
        let surrogate = Self::with_rasterizer(self.rasterizer, self.faces.clone(), softness, phi);
        self.surrogate = Some(Box::new(surrogate));
        self
    }

    /// The softness of the image.
    pub fn softness(&self) -> &S {
        &self.softness
    }

    /// The renderer whose gradient with respect to the vertices is used, if it differs from the image's.
    pub fn surrogate(&self) -> Option<&Self> {
        self.surrogate.as_deref()
    }

    /// The parameters φ, `[parameters]`, used by [`silhouette`](Self::silhouette).
    pub fn phi(&self) -> &[f64] {
        &self.phi
    }

    /// The parameters as a tensor to optimise, for [`silhouette_with`](Self::silhouette_with).
    pub fn phi_tensor<B: Backend>(&self, device: &B::Device) -> Tensor<B, 1> {
        tensor_on(self.phi.clone(), [self.phi.len()], device)
    }

    /// The largest error of a pixel with the renderer's own parameters, in coverage: the tolerance, or more if the softness has a jump or a
    /// corner that no table can resolve. In exact arithmetic; rounding in `f32` adds up to 1e-5.
    ///
    /// ```
    /// use softrast_tensor::NdArray;
    /// use softrast_raster::SoftRenderer;
    /// use softrast_softness::Family;
    ///
    /// let renderer = SoftRenderer::new(&[[0, 1, 2]], 32, Family::Logistic, 0.01).with_tolerance(1e-6);
    /// assert_eq!(renderer.error_bound::<NdArray>(), 1e-6);
    /// ```
    pub fn error_bound<B: RasterBackend>(&self) -> f64 {
        self.prepared::<B>(&self.phi).profile().error()
    }

    /// The distance from a face up to which it is drawn, in NDC: beyond it, the softness is negligible within the tolerance.
    ///
    /// The image is 2 wide, so a heavy tail may have every face drawn at every pixel, which takes many times longer. The remedy is a
    /// softness with bounded support ([`Truncated`](softrast_softness::Truncated)), or a larger tolerance if that is enough:
    ///
    /// ```
    /// use softrast_tensor::NdArray;
    /// use softrast_raster::SoftRenderer;
    /// use softrast_softness::{Family, Truncated};
    ///
    /// let reach = |family| SoftRenderer::new(&[[0, 1, 2]], 64, family, 0.01).reach::<NdArray>();
    /// assert!(reach(Family::Cauchy) > 2.0 && reach(Family::Gauss) < 0.1);
    /// let ended = Truncated::new(Family::Cauchy, 4.0);
    /// assert!(SoftRenderer::new(&[[0, 1, 2]], 64, ended, 0.01).reach::<NdArray>() < 0.05);
    /// let looser = SoftRenderer::new(&[[0, 1, 2]], 64, Family::Cauchy, 0.01).with_tolerance(1e-2);
    /// assert!(looser.reach::<NdArray>() < 2.0);
    /// ```
    pub fn reach<B: RasterBackend>(&self) -> f64 {
        self.prepared::<B>(&self.phi).profile().grid().outer
    }

    /// Sets the parameters.
    ///
    /// # Panics
    ///
    /// If their number differs from that of the softness.
    pub fn set_phi(&mut self, phi: Vec<f64>) {
        check(&self.softness, &phi);
        self.phi = phi;
    }

    /// Sets the parameters to the defaults of the softness for this width. Other parameters, of a network for example, are lost: change the
    /// scale of such a softness by [`set_phi`](Self::set_phi).
    ///
    /// # Panics
    ///
    /// If the width is not positive.
    pub fn set_width(&mut self, width: impl Into<Width>) {
        self.phi = width.into().phi(&self.softness, self.rasterizer.size);
    }

    /// Coverage `[views, height, width]` in [0, 1], top row first, with the renderer's own parameters.
    ///
    /// `vertices` `[views, vertices, 3]` are the result of [`project`](crate::project). They receive gradients, to second order on
    /// `Autodiff<Autodiff<B>>`.
    pub fn silhouette<B: RasterBackend>(&self, vertices: Projected<B>) -> Tensor<B, 3> {
        let seen = vertices.clone().tensor();
        let (silhouette, table) = self.own_table(&seen);
        let soft = self.drawn(&silhouette, seen, table);
        self.shown(vertices, soft)
    }

    /// [`silhouette`](Self::silhouette) with parameters `phi` `[parameters]`, which receive gradients too, unless there is a surrogate.
    ///
    /// Their values are read from the device, to check whether support and knots still fit.
    ///
    /// # Panics
    ///
    /// If `phi` has the wrong length.
    pub fn silhouette_with<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        phi: &Tensor<B, 1>,
    ) -> Tensor<B, 3> {
        let values: Vec<f64> = phi.to_data().iter().collect();
        let silhouette = self.prepared::<B>(&values);
        let table = silhouette.table(phi.clone());
        let soft = self.drawn(&silhouette, vertices.clone().tensor(), table);
        self.shown(vertices, soft)
    }

    /// The soft image, or hard coverage with the gradient of the soft image.
    fn shown<B: RasterBackend>(&self, vertices: Projected<B>, soft: Tensor<B, 3>) -> Tensor<B, 3> {
        let Some(samples) = self.samples else { return soft };
        let Rasterizer { size, culls, .. } = self.rasterizer;
        let hard = hard_coverage_of(vertices, &self.faces, size, samples, culls);
        soft.clone() + (hard - soft.detach())
    }

    /// This renderer on images of another size. Both share knots and tables.
    ///
    /// # Panics
    ///
    /// If the image is empty.
    #[must_use]
    pub fn sized(&self, size: impl Into<ImageSize>) -> Self {
        let size = size.into();
        assert!(size.pixels() > 0, "an image needs at least one pixel");
        let rasterizer = Rasterizer { size, ..self.rasterizer };
        let surrogate = self.surrogate.as_ref().map(|surrogate| Box::new(surrogate.sized(size)));
        Self { rasterizer, surrogate, ..self.clone() }
    }

    /// This renderer with other parameters, also of the surrogate if there is one. Its knots are initially derived from the current ones,
    /// and its table is separate.
    ///
    /// # Panics
    ///
    /// If the number of parameters differs from that of the softnesses, or parameters are given for a missing surrogate.
    #[must_use]
    pub fn with_phi<B: RasterBackend>(
        &self,
        phi: Vec<f64>,
        surrogate_phi: Option<Vec<f64>>,
    ) -> Self {
        let surrogate = match (&self.surrogate, surrogate_phi) {
            (Some(surrogate), Some(phi)) => Some(Box::new(surrogate.with_phi::<B>(phi, None))),
            (None, None) => None,
            _ => panic!("parameters of a surrogate belong to a renderer that has one"),
        };
        let cache = Cache::beginning_with(self.knots::<B>(&phi));
        Self { phi, surrogate, cache, ..self.clone() }
    }

    /// The [`Silhouette`] for parameters `phi`, with support and knots for them.
    ///
    /// # Panics
    ///
    /// If `phi` has the wrong length.
    pub fn prepared<B: RasterBackend>(&self, phi: &[f64]) -> Silhouette<S> {
        self.knots::<B>(phi).silhouette.sized(self.rasterizer.size)
    }

    fn knots<B: RasterBackend>(&self, phi: &[f64]) -> Knots<S> {
        check(&self.softness, phi);
        let drawn = (B::ON_HOST, <B::FloatElem as Element>::dtype());
        let reused =
            |knots: &Knots<S>| (knots.drawn == drawn).then(|| knots.stretched_to(phi)).flatten();
        self.cache.knots(reused, || {
            let (faces, room, softness) = (&self.faces, self.room, self.softness.clone());
            let silhouette =
                self.rasterizer.prepare_for::<B, HostBackend, S>(room, faces, softness, phi);
            Knots { phi: phi.to_vec(), drawn, room, silhouette }
        })
    }

    fn drawn<B: RasterBackend>(
        &self,
        silhouette: &Silhouette<S>,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
    ) -> Tensor<B, 3> {
        let Some(surrogate) = &self.surrogate else {
            return silhouette.coverage_by_table(vertices, table);
        };
        let (wide, wide_table) = surrogate.own_table(&vertices);
        silhouette.coverage_with_surrogate(vertices, table, &wide, wide_table)
    }

    /// The silhouette of these vertices with the renderer's own parameters, and its table.
    fn own_table<B: RasterBackend>(
        &self,
        vertices: &Tensor<B, 3>,
    ) -> (Silhouette<S>, Tensor<B, 2>) {
        let knots = self.knots::<B>(&self.phi);
        let data = self.cache.table(&knots, || knots.silhouette.table_data(&self.phi));
        let table = Tensor::from_data(data, (&vertices.device(), vertices.dtype()));
        (knots.silhouette.sized(self.rasterizer.size), table)
    }

    fn changed(mut self, change: impl Fn(&mut Rasterizer) + Copy) -> Self {
        change(&mut self.rasterizer);
        self.cache = Cache::default();
        self.surrogate = self.surrogate.map(|surrogate| Box::new(surrogate.changed(change)));
        self
    }
}

fn check(softness: &impl Softness, phi: &[f64]) {
    let (found, expected) = (phi.len(), softness.parameters());
    assert_eq!(found, expected, "{softness:?} has {expected} parameters, found {found}");
}
