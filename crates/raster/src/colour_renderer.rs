mod losses;
mod op;
mod prepared;

use std::sync::Arc;

use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Backend, Tensor, tensor_on, vector};

pub use self::prepared::WeightTables;
use self::{op::Call, prepared::Prepared};
use crate::{
    Attributes, Background, HostBackend, ImageSize, Projected, RasterBackend, Rasterizer,
    Weighting, Width, cache::Cache, curve::precise, ops::FusedOp, ops::blend::SoftBlend,
    weighting::floor,
};

/// Default weight of the background, relative to a face at the far plane.
const BEHIND: f64 = 1e-3;

/// Draws soft colour images of one mesh topology, for any edge softness.
///
/// Each pixel is the weighted mean of all faces and a background. The weight of a face is its edge softness (how much it covers the pixel)
/// times its depth softness: `C = (Σⱼ wⱼ cⱼ + w c) / (Σⱼ wⱼ + w)` with `wⱼ = s(dⱼ) b(zⱼ)`. The image therefore changes smoothly as faces
/// move, also where one passes in front of another. [`reference::blended`](crate::reference::blended) is the full definition.
///
/// The error of a pixel is at most the tolerance times the range of the attributes, in exact arithmetic: the tables of both softnesses are
/// chosen for the tolerance, and culled weights are bounded relative to the background's weight. If no table can meet the tolerance,
/// [`error_bound`](Self::error_bound) is larger and states the remaining error. In f32, logarithms of weights have a relative error of
/// 1e-7. An edge softness that is 0 beyond some distance is resolved to 1e-11, so the weight of its background should be at least 1e-6 of
/// that of the nearest faces. With a softness that is never negligible, such as the network, every face is drawn at every pixel.
///
/// Limits: as the edge softness narrows, a face counts only where it covers a pixel; as the depth softness narrows too, only the nearest
/// face counts, which is the hard image. The faces' share is `Σⱼ wⱼ / (Σⱼ wⱼ + w)`; unlike the coverage of a silhouette it grows with each
/// face. It tends to the hard silhouette as the edge narrows and `w / b` vanishes. The order of the faces changes the image only by
/// rounding.
///
/// ```
/// use softrast_tensor::{Autodiff, NdArray};
/// use softrast_raster::{Attributes, ColourRenderer, Projected, vertex_tensor};
/// use softrast_softness::Family;
///
/// let device = Default::default();
/// let faces = [[0, 1, 2]];
/// let corners = vertex_tensor::<Autodiff<NdArray>>(&[[-0.5, -0.5, 2.0], [0.5, -0.5, 2.0], [0.0, 0.5, 3.0]], &device);
/// let red = vertex_tensor(&[[1.0, 0.0, 0.0]; 3], &device).require_grad();
/// let renderer = ColourRenderer::new(&faces, 16, Family::Logistic, 0.01, [1.0, 4.0]);
/// let background = renderer.background(&[0.0, 0.0, 1.0], &device);
/// let image = renderer.image(Projected::new(corners), &Attributes::of_vertices(red.clone(), &faces), &background);
/// assert_eq!(image.dims(), [1, 4, 16, 16]); // red, green, blue, and the share of the faces
/// let gradient = red.grad(&image.mean().backward()).unwrap();
/// assert_eq!(gradient.dims(), [1, 3, 3]);
/// ```
#[doc(alias = "ColorRenderer")]
#[derive(Clone, Debug)]
pub struct ColourRenderer<S = EdgeSoftness> {
    faces: Arc<[[u32; 3]]>,
    /// Number of faces that knots are chosen for: at least the number of faces.
    room: usize,
    size: ImageSize,
    weighting: Weighting<S>,
    phi: [Vec<f64>; 2],
    tolerance: f64,
    culls: bool,
    cache: Cache<Prepared<S>>,
    #[cfg(feature = "gpu")]
    topology: crate::gpu::Topology,
}

impl ColourRenderer {
    /// Default scale of the depth softness, in units of the distance between the planes.
    pub const DEPTH_SCALE: f64 = 0.05;
}

impl<S: Softness> ColourRenderer<S> {
    /// Draws meshes with these `faces` (corners as vertex numbers) on images of `size` pixels, a square or `[height, width]`. The edge
    /// softness has this [`Width`] (a number is its scale). The depth softness is the reversed exponential, as in `SoftRas` and PyTorch3D:
    /// a face has e times the weight of one that is [`DEPTH_SCALE`](ColourRenderer::DEPTH_SCALE) of the distance between the planes behind
    /// it. `planes` are the depths of nearness 1 and 0 (ascending, world units); [`Projected::planes`] computes planes around a scene.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, the width is not positive, or the planes do not ascend.
    pub fn new(
        faces: &[[u32; 3]],
        size: impl Into<ImageSize>,
        edge: S,
        width: impl Into<Width>,
        planes: [f64; 2],
    ) -> Self {
        let (depth, size) = (DepthSoftness::Family(Family::Exp), size.into());
        let phi = [width.into().phi(&edge, size), depth.default_phi(ColourRenderer::DEPTH_SCALE)];
        let weighting = Weighting { edge, depth, planes };
        Self::with_weighting(faces.into(), size, weighting, phi)
    }

    /// A renderer from a [`Weighting`]; `phi` are the parameters of the edge and the depth softness.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, the planes do not ascend, or a `phi` has the wrong length.
    pub fn with_weighting(
        faces: Arc<[[u32; 3]]>,
        size: impl Into<ImageSize>,
        weighting: Weighting<S>,
        phi: [Vec<f64>; 2],
    ) -> Self {
        let size = size.into();
        assert!(size.pixels() > 0, "an image needs at least one pixel");
        assert!(!faces.is_empty(), "an image needs at least one face");
        let [near, far] = weighting.planes;
        assert!(near < far, "the near plane {near} is not nearer than the far plane {far}");
        check(&weighting, &phi);
        let tolerance = Rasterizer::TOLERANCE;
        Self {
            room: faces.len(),
            faces,
            size,
            weighting,
            phi,
            tolerance,
            culls: false,
            cache: Cache::default(),
            #[cfg(feature = "gpu")]
            topology: Default::default(),
        }
    }

    /// This renderer for other faces. Knots and tables are reused unless there are many more faces than before, so a change of topology
    /// during an optimisation costs only the new list of faces.
    ///
    /// # Panics
    ///
    /// If there are no faces.
    #[must_use]
    pub fn with_faces(&self, faces: impl Into<Arc<[[u32; 3]]>>) -> Self {
        let faces: Arc<[[u32; 3]]> = faces.into();
        assert!(!faces.is_empty(), "an image needs at least one face");
        Self {
            room: faces.len().next_power_of_two(),
            faces,
            #[cfg(feature = "gpu")]
            topology: Default::default(),
            ..self.clone()
        }
    }

    /// Sets the largest error of a pixel, relative to the range of the attributes, in (0, 1).
    ///
    /// # Panics
    ///
    /// If `tolerance` is not in (0, 1).
    #[must_use]
    pub fn with_tolerance(mut self, tolerance: f64) -> Self {
        assert!(tolerance > 0.0 && tolerance < 1.0, "tolerance {tolerance} is not in (0, 1)");
        (self.tolerance, self.cache) = (tolerance, Cache::default());
        self
    }

    /// Culls back faces: those whose corners appear clockwise to the camera. For closed meshes whose faces are counter-clockwise from
    /// outside: their back faces are hidden by front faces and take half of the time.
    ///
    /// The image is that of the front faces only. It jumps where a face turns, by the weight of its colour at the edges.
    #[must_use]
    pub fn without_back_faces(mut self) -> Self {
        self.culls = true;
        self
    }

    /// Sets the depth softness, with this scale in units of the distance between the planes.
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    #[must_use]
    pub fn with_depth(mut self, depth: DepthSoftness, scale: f64) -> Self {
        (self.weighting.depth, self.phi[1]) = (depth, depth.default_phi(scale));
        self.cache = Cache::default();
        self
    }

    /// The weighting of faces.
    pub fn weighting(&self) -> &Weighting<S> {
        &self.weighting
    }

    /// The parameters φ of the edge and the depth softness, used by [`image`](Self::image).
    pub fn phi(&self) -> &[Vec<f64>; 2] {
        &self.phi
    }

    /// Sets the parameters.
    ///
    /// # Panics
    ///
    /// If their number differs from that of the softnesses.
    pub fn set_phi(&mut self, phi: [Vec<f64>; 2]) {
        check(&self.weighting, &phi);
        self.phi = phi;
    }

    /// Sets the parameters of the edge softness to the defaults for this width, as [`SoftRenderer::set_width`](crate::SoftRenderer::set_width)
    /// does. The depth softness keeps its own.
    ///
    /// ```
    /// use softrast_raster::ColourRenderer;
    /// use softrast_softness::Family;
    ///
    /// let of_width = |width| ColourRenderer::new(&[[0, 1, 2]], 16, Family::Logistic, width, [1.0, 4.0]);
    /// let mut renderer = of_width(0.1);
    /// renderer.set_width(0.01);
    /// assert_eq!(renderer.phi(), of_width(0.01).phi());
    /// ```
    ///
    /// # Panics
    ///
    /// If the width is not positive.
    pub fn set_width(&mut self, width: impl Into<Width>) {
        self.phi[0] = width.into().phi(&self.weighting.edge, self.size);
    }

    /// The largest error of a pixel with this background and the renderer's own parameters, relative to the range of the attributes: the
    /// tolerance, or more if a softness has a jump or a corner that no table can resolve. In exact arithmetic.
    pub fn error_bound<B: Backend>(&self, background: &Background<B>) -> f64 {
        let prepared = self.prepared(&self.phi, number(background));
        // Each table has a share in proportion to its error; half of the tolerance is for culling.
        let tables = [prepared.edge.error, prepared.depth.error()].map(|error| error.max(1.0));
        self.tolerance * (0.5 + 0.25 * (tables[0] + tables[1]))
    }

    /// A background of this colour, whose weight is a thousandth of that of a face at the far plane: where a face covers a pixel, its share
    /// is at most that; where no face does, it dominates.
    pub fn background<B: Backend>(&self, colour: &[f64], device: &B::Device) -> Background<B> {
        let phi = vector::<HostBackend>(&self.phi[1]);
        let far = self.weighting.depth.log_weight(phi, vector::<HostBackend>(&[0.0]));
        let log_weight = f64::from(far.into_scalar()) + BEHIND.ln();
        Background {
            colour: tensor_on(colour.to_vec(), [colour.len()], device),
            log_weight: tensor_on(vec![log_weight], [1], device),
        }
    }

    /// Blended channels and, last, the share of the faces: `[views, channels + 1, height, width]`, top row first.
    ///
    /// `vertices` `[views, vertices, 3]` are the result of [`project`](crate::project). Gradients reach the vertices, the attributes and
    /// the background, to second order on `Autodiff<Autodiff<B>>`.
    ///
    /// On a GPU each image reads back one number, the background's weight.
    ///
    /// # Panics
    ///
    /// If shapes do not fit, or float types differ.
    pub fn image<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        attributes: &Attributes<B>,
        background: &Background<B>,
    ) -> Tensor<B, 4> {
        self.call(vertices, attributes, background).image()
    }

    /// The op of an image, and its inputs.
    fn call<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        attributes: &Attributes<B>,
        background: &Background<B>,
    ) -> Call<B> {
        let vertices = vertices.tensor();
        let (device, dtype) = (vertices.device(), vertices.dtype());
        let prepared = self.prepared(&self.phi, number(background));
        let data = self.cache.table(&prepared, || {
            // In f64 whatever the backend draws in: f32 rounding is visible in the tables of some families.
            let precise = |phi: &Vec<f64>| precise::<HostBackend>(phi, &Default::default());
            prepared.tables(self.phi.each_ref().map(precise)).into_data()
        });
        let tables = Tensor::from_data(data, (&device, dtype));
        self.drawn(&prepared, vertices, attributes, tables, background)
    }

    /// [`image`](Self::image) with parameters φ of the edge and the depth softness, which receive gradients too. On a GPU each image waits
    /// to read them back, which is impossible in a browser.
    ///
    /// ```
    /// use softrast_raster::{Attributes, ColourRenderer, HostBackend, Projected, vertex_tensor};
    /// use softrast_softness::{DepthSoftness, Family};
    /// use softrast_tensor::{Autodiff, vector};
    ///
    /// let (faces, device) = ([[0, 1, 2]], Default::default());
    /// let corners = [[-0.5, -0.5, 2.0], [0.5, -0.5, 2.0], [0.0, 0.5, 2.0]];
    /// let corners = Projected::new(vertex_tensor::<Autodiff<HostBackend>>(&corners, &device));
    /// let white = Attributes::of_vertices(vertex_tensor(&[[1.0; 3]; 3], &device), &faces);
    /// let renderer = ColourRenderer::new(&faces, 8, Family::Logistic, 0.05, [1.0, 3.0])
    ///     .with_depth(DepthSoftness::Family(Family::Logistic), 0.2);
    /// let [edge, depth] = renderer.phi().each_ref().map(|phi| vector(phi).require_grad());
    /// let background = renderer.background(&[0.0; 3], &device);
    /// let image = renderer.image_with(corners, &white, [&edge, &depth], &background);
    /// let gradients = image.mean().backward();
    /// assert!(edge.grad(&gradients).is_some() && depth.grad(&gradients).is_some());
    /// ```
    ///
    /// # Panics
    ///
    /// If shapes do not fit, or float types differ.
    pub fn image_with<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        attributes: &Attributes<B>,
        [edge, depth]: [&Tensor<B, 1>; 2],
        background: &Background<B>,
    ) -> Tensor<B, 4> {
        let phi = [edge.clone(), depth.clone()];
        let values = [edge, depth].map(|phi| phi.to_data().iter().collect::<Vec<f64>>());
        check(&self.weighting, &values);
        let prepared = self.prepared(&values, number(background));
        let tables = prepared.tables(phi);
        self.drawn(&prepared, vertices.tensor(), attributes, tables, background).image()
    }

    /// The op of [`image_with`](Self::image_with), and the tables it needs, for callers that run it on slices: for these values of the
    /// parameters and of the logarithm of the background's weight, attributes with these `entries` at the corners of faces, and the rows
    /// and columns of the texture if the attributes are texture coordinates.
    ///
    /// # Panics
    ///
    /// If a `phi` has the wrong length, or the logarithm is not finite.
    #[doc(hidden)]
    pub fn op(
        &self,
        phi: &[Vec<f64>; 2],
        log_weight: f64,
        entries: Arc<[[u32; 3]]>,
        texture: Option<[usize; 2]>,
    ) -> (FusedOp, WeightTables<S>) {
        check(&self.weighting, phi);
        let prepared = self.prepared(phi, log_weight);
        let op = self.blend_op(&prepared, entries, texture);
        (FusedOp::SoftBlend(op), WeightTables(prepared))
    }

    fn drawn<B: RasterBackend>(
        &self,
        prepared: &Prepared<S>,
        vertices: Tensor<B, 3>,
        attributes: &Attributes<B>,
        tables: Tensor<B, 2>,
        background: &Background<B>,
    ) -> Call<B> {
        let texture = attributes.texture.as_ref().map(texture_size);
        let op = self.blend_op(prepared, attributes.entries.clone(), texture);
        Call::new(op, vertices, attributes, tables, background)
    }

    fn blend_op(
        &self,
        prepared: &Prepared<S>,
        entries: Arc<[[u32; 3]]>,
        texture: Option<[usize; 2]>,
    ) -> SoftBlend {
        SoftBlend {
            faces: self.faces.clone(),
            entries,
            texture,
            edge: prepared.edge.grid(),
            depth: prepared.depth.grid(),
            floor: floor(&self.weighting.edge),
            planes: self.weighting.planes,
            size: self.size,
            tolerance: 0.5 * self.tolerance,
            culls: self.culls,
            kept: None,
            #[cfg(feature = "gpu")]
            topology: self.topology.clone(),
        }
    }

    /// Knots for these parameters and this logarithm of the background's weight.
    fn prepared(&self, phi: &[Vec<f64>; 2], log_weight: f64) -> Prepared<S> {
        assert!(log_weight.is_finite(), "log weight {log_weight}");
        let reused = |last: &Prepared<S>| {
            (log_weight >= last.log_weight && last.room >= self.faces.len())
                .then(|| last.stretched_to(&self.weighting, phi))
                .flatten()
        };
        let (room, tolerance) = (self.room, self.tolerance);
        let choose = || Prepared::new(&self.weighting, phi, room, tolerance, log_weight);
        self.cache.knots(reused, choose)
    }
}

/// The logarithm of the background's weight.
fn number<B: Backend>(background: &Background<B>) -> f64 {
    let numbers = background.log_weight.to_data().iter().collect::<Vec<f64>>();
    assert_eq!(numbers.len(), 1, "logarithms of the background's weight");
    numbers[0]
}

fn check(weighting: &Weighting<impl Softness>, phi: &[Vec<f64>; 2]) {
    let found = phi.each_ref().map(Vec::len);
    let expected = [weighting.edge.parameters(), weighting.depth.parameters()];
    assert_eq!(found, expected, "parameters of the softnesses by edge and by depth");
}

fn texture_size<B: Backend>(texture: &Tensor<B, 3>) -> [usize; 2] {
    let [height, width, _] = texture.dims();
    [height, width]
}
