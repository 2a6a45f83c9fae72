use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use softrast_softness::Softness;
use softrast_tensor::{Backend, DType, Element, Tensor, TensorData};

use crate::{
    HostBackend, ImageSize, Profile, RasterBackend, Rasterizer, Silhouette, TConorm,
    kernel::PixelLoss,
};

/// Parameters that differ by no more than this, relative to the larger of 1 and themselves, count as the same.
const SAME: f64 = 1e-12;

/// Draws soft silhouettes of one mesh topology.
///
/// It holds what an image depends on beside the vertices: faces, size, softness, T-conorm and tolerance. Support and knots follow the
/// parameters φ by themselves, so no pixel is off by more than the tolerance in exact arithmetic, wherever the parameters go. Where no
/// table can meet the tolerance, [`error_bound`](Self::error_bound) is larger and states the error that is left. Where only the scale of the softness has changed they
/// are stretched, which costs nothing; where its shape has, they are chosen anew, which takes milliseconds.
///
/// ```
/// use softrast_tensor::{Autodiff, NdArray};
/// use softrast_raster::{Orbit, SoftRenderer, project, vertices};
/// use softrast_softness::Family;
///
/// let device = Default::default();
/// let corners = vertices::<Autodiff<NdArray>>(&[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &device);
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
    softness: S,
    phi: Vec<f64>,
    surrogate: Option<Box<Self>>,
    kept: Arc<Mutex<Kept<S>>>,
}

/// What the last image needed and the next one may need again.
#[derive(Debug)]
struct Kept<S> {
    prepared: Option<Prepared<S>>,
    table: Option<Table>,
}

/// Support and knots, for the parameters `phi` and others of the same shape.
#[derive(Debug)]
struct Prepared<S> {
    phi: Vec<f64>,
    /// Whether it is drawn on the CPU, and in which float type.
    drawn: (bool, DType),
    silhouette: Silhouette<S>,
}

/// The table of the parameters `phi` at the knots of a profile.
#[derive(Debug)]
struct Table {
    phi: Vec<f64>,
    profile: Profile,
    data: TensorData,
}

impl<S: Softness> SoftRenderer<S> {
    /// Draws meshes with these `faces` (corners as vertex numbers) on images of `size` pixels, a square or `[height, width]`, under a softness
    /// of this `scale` (NDC, or NDC² if squared; one pixel is 2 over the shorter side), the probabilistic sum and [`Rasterizer::TOLERANCE`].
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, or `scale` is not positive.
    pub fn new(faces: &[[u32; 3]], size: impl Into<ImageSize>, softness: S, scale: f64) -> Self {
        let phi = softness.default_phi(scale);
        Self::with_rasterizer(Rasterizer::new(size), faces.into(), softness, phi)
    }

    /// The same from parts: `phi` `[parameters]` are the parameters of the softness.
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
        Self { rasterizer, faces, softness, phi, surrogate: None, kept: Arc::default() }
    }

    /// With another largest error of a pixel, in (0, 1); see [`Profile::new`](crate::low_level::Profile::new).
    #[must_use]
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        self.changed(|rasterizer| rasterizer.tolerance = tolerance)
    }

    /// With another way to make one coverage of those of several faces.
    #[must_use]
    pub fn with_t_conorm(self, t_conorm: TConorm) -> Self {
        self.changed(|rasterizer| rasterizer.t_conorm = t_conorm)
    }

    /// With another softness in the backward pass, at this `scale`: a sharp image with a wide gradient. What comes back is not the
    /// derivative of the image; see [`Silhouette::coverage_with_surrogate`].
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    #[must_use]
    pub fn with_surrogate(self, softness: S, scale: f64) -> Self {
        let phi = softness.default_phi(scale);
        self.with_surrogate_phi(softness, phi)
    }

    /// A surrogate with parameters `phi` `[parameters]` in place of a scale; see [`with_surrogate`](Self::with_surrogate).
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

    /// The renderer that the gradient to the vertices is taken of, where that is not the image itself.
    pub fn surrogate(&self) -> Option<&Self> {
        self.surrogate.as_deref()
    }

    /// The parameters φ, `[parameters]`: those to draw with where no others are given.
    pub fn phi(&self) -> &[f64] {
        &self.phi
    }

    /// The same as a tensor to be optimised, for [`silhouette_with`](Self::silhouette_with).
    pub fn phi_tensor<B: Backend>(&self, device: &B::Device) -> Tensor<B, 1> {
        let data = TensorData::new(self.phi.clone(), [self.phi.len()]);
        Tensor::from_data(data, (device, <B::FloatElem as Element>::dtype()))
    }

    /// The largest error of a pixel under the renderer's own parameters, in coverage: the tolerance, or more where the softness has a
    /// jump or a corner that no table can follow to it. In exact arithmetic; rounding in `f32` adds some 1e-6.
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

    /// Draws with these parameters from now on.
    ///
    /// # Panics
    ///
    /// If there are more or fewer of them than the softness has.
    pub fn set_phi(&mut self, phi: Vec<f64>) {
        check(&self.softness, &phi);
        self.phi = phi;
    }

    /// Coverage `[views, height, width]` in [0, 1], top row first, under the renderer's own parameters.
    ///
    /// `vertices` `[views, vertices, 3]` holds x and y in NDC and the camera depth, as [`project`](crate::project) returns them. It
    /// receives gradients, to second order on `Autodiff<Autodiff<B>>`.
    pub fn silhouette<B: RasterBackend>(&self, vertices: Tensor<B, 3>) -> Tensor<B, 3> {
        let (silhouette, table) = self.own_table(&vertices);
        self.drawn(&silhouette, vertices, table)
    }

    /// [`silhouette`](Self::silhouette) under parameters `phi` `[parameters]`, which receive gradients too, unless there is a surrogate.
    ///
    /// Their values are read from the device, to see whether support and knots still suit them.
    ///
    /// # Panics
    ///
    /// If `phi` has the wrong length.
    pub fn silhouette_with<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        phi: &Tensor<B, 1>,
    ) -> Tensor<B, 3> {
        let values: Vec<f64> = phi.to_data().iter().collect();
        let silhouette = self.prepared::<B>(&values);
        let table = silhouette.table(phi.clone());
        self.drawn(&silhouette, vertices, table)
    }

    /// What draws under parameters `phi`, with support and knots for them.
    ///
    /// # Panics
    ///
    /// If `phi` has the wrong length.
    pub fn prepared<B: RasterBackend>(&self, phi: &[f64]) -> Silhouette<S> {
        check(&self.softness, phi);
        let drawn = (B::ON_HOST, <B::FloatElem as Element>::dtype());
        let kept = |kept: &Kept<S>| {
            let prepared = kept.prepared.as_ref().filter(|it| it.drawn == drawn);
            prepared.and_then(|prepared| prepared.stretched_to(phi))
        };
        if let Some(silhouette) = kept(&self.kept()) {
            return silhouette;
        }
        // Without the lock: other threads of a pool may take up work in between, and ask for the same.
        let (faces, softness) = (&self.faces, self.softness.clone());
        let silhouette = self.rasterizer.prepare_on::<B, HostBackend, S>(faces, softness, phi);
        let prepared = silhouette.clone();
        self.kept().prepared = Some(Prepared { phi: phi.to_vec(), drawn, silhouette: prepared });
        silhouette
    }

    /// The [`mse_loss`](crate::mse_loss) of each view against a target `[1 or views, height, width]`, `[views]`: that of the
    /// [`silhouette`](Self::silhouette). Gradients reach the vertices alone, to second order.
    ///
    /// On the CPU, under the probabilistic sum and without a surrogate, it is one op that computes the gradient along with the image. It
    /// takes two thirds to nine tenths of the time of two ops.
    ///
    /// # Panics
    ///
    /// If the target is of another size.
    pub fn mse_loss<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        target: Tensor<B, 3>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::SquaredError, vertices, target)
    }

    /// The [`iou_loss`](crate::iou_loss) of each view, likewise.
    ///
    /// # Panics
    ///
    /// If the target is of another size.
    pub fn iou_loss<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        target: Tensor<B, 3>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::Iou, vertices, target)
    }

    fn loss<B: RasterBackend>(
        &self,
        loss: PixelLoss,
        vertices: Tensor<B, 3>,
        target: Tensor<B, 3>,
    ) -> Tensor<B, 1> {
        if self.surrogate.is_some() {
            return loss.of_images(self.silhouette(vertices), target.detach());
        }
        let (silhouette, table) = self.own_table(&vertices);
        silhouette.loss(loss, vertices, table, target, None)
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

    /// What draws these vertices under the renderer's own parameters, and its table.
    fn own_table<B: RasterBackend>(
        &self,
        vertices: &Tensor<B, 3>,
    ) -> (Silhouette<S>, Tensor<B, 2>) {
        let silhouette = self.prepared::<B>(&self.phi);
        let profile = *silhouette.profile();
        let is_of = |table: &&Table| table.phi == self.phi && table.profile == profile;
        let kept = self.kept().table.as_ref().filter(is_of).map(|table| table.data.clone());
        let data = kept.unwrap_or_else(|| {
            let data = silhouette.table_data(&self.phi);
            let table = Table { phi: self.phi.clone(), profile, data: data.clone() };
            self.kept().table = Some(table);
            data
        });
        (silhouette, Tensor::from_data(data, (&vertices.device(), vertices.dtype())))
    }

    fn kept(&self) -> MutexGuard<'_, Kept<S>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn changed(mut self, change: impl Fn(&mut Rasterizer) + Copy) -> Self {
        change(&mut self.rasterizer);
        self.kept = Arc::default();
        self.surrogate = self.surrogate.map(|surrogate| Box::new(surrogate.changed(change)));
        self
    }
}

impl<S: Softness> Prepared<S> {
    /// What draws under parameters `phi`, if their softness is the prepared one stretched.
    fn stretched_to(&self, phi: &[f64]) -> Option<Silhouette<S>> {
        let widened = stretch(self.silhouette.softness(), &self.phi, phi)?;
        self.silhouette.stretched(widened)
    }
}

/// By how much a step with parameters `now` is stretched against one with those `before`, if that is all that they differ by.
pub(crate) fn stretch(softness: &impl Softness, before: &[f64], now: &[f64]) -> Option<f64> {
    let factor = softness.scale(now) / softness.scale(before);
    let stretched = softness.with_scale_values(before, factor);
    let same = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME * b.abs().max(1.0);
    stretched.iter().zip(now).all(same).then(|| softness.width(now) / softness.width(before))
}

impl<S> Default for Kept<S> {
    fn default() -> Self {
        Self { prepared: None, table: None }
    }
}

fn check(softness: &impl Softness, phi: &[f64]) {
    let (found, expected) = (phi.len(), softness.parameters());
    assert_eq!(found, expected, "{softness:?} has {expected} parameters, found {found}");
}
