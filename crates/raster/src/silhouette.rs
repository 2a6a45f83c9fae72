use std::sync::Arc;

use softrast_kernel::PixelLoss;
use softrast_softness::Softness;
use softrast_tensor::{Backend, Tensor, TensorData};

use crate::{
    HostBackend, ImageSize, NEAR, Profile, ProfileSum, RasterBackend, TConorm,
    backend::{elementary, pairs, primitive, silhouette_loss, straight_through_sum},
    curve::precise,
    loss::loss_of_images,
    ops::{ElementaryOp, FusedOp},
    profile_sum,
};

/// How silhouettes are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rasterizer {
    /// Height and width of the image in pixels.
    pub size: ImageSize,
    /// Largest error of any pixel against evaluating every pixel-face pair; see [`Profile::new`].
    pub tolerance: f64,
    /// How the coverages of several faces make one.
    pub t_conorm: TConorm,
    /// Whether back faces are not drawn: those whose corners the camera sees clockwise.
    pub culls: bool,
}

impl Rasterizer {
    /// The largest error of a pixel unless asked for another.
    pub const TOLERANCE: f64 = 1e-5;

    /// A rasterizer for images of `size` pixels, a square or `[height, width]`, with the probabilistic sum and the default tolerance.
    pub fn new(size: impl Into<ImageSize>) -> Self {
        let size = size.into();
        Self { size, tolerance: Self::TOLERANCE, t_conorm: TConorm::Probabilistic, culls: false }
    }

    /// Prepares silhouettes of meshes with these faces, for a softness near the parameters `phi`.
    ///
    /// The parameters decide the support and the knots only; they are read from the tensor once.
    /// Prepare anew when they have moved so far that the support no longer fits.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, or `phi` has the wrong length.
    pub fn prepare<B: RasterBackend, S: Softness>(
        &self,
        faces: &Arc<[[u32; 3]]>,
        softness: S,
        phi: &Tensor<B, 1>,
    ) -> Silhouette<S> {
        let values: Vec<f64> = phi.to_data().iter().collect();
        match B::ON_HOST {
            true => self.prepare_on::<B, B, S>(faces, softness, &values),
            // Without a word between host and GPU for every attempt.
            false => self.prepare_on::<B, HostBackend, S>(faces, softness, &values),
        }
    }

    /// [`Rasterizer::prepare`] from plain numbers. Support and knots are chosen on `H`, in f64 if it has that.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, or `phi` has the wrong length.
    pub fn prepare_on<B: RasterBackend, H: Backend, S: Softness>(
        &self,
        faces: &Arc<[[u32; 3]]>,
        softness: S,
        phi: &[f64],
    ) -> Silhouette<S> {
        self.prepare_for::<B, H, S>(faces.len(), faces, softness, phi)
    }

    /// [`Rasterizer::prepare_on`] with knots that serve `room` faces, as many as there are or more.
    pub(crate) fn prepare_for<B: RasterBackend, H: Backend, S: Softness>(
        &self,
        room: usize,
        faces: &Arc<[[u32; 3]]>,
        softness: S,
        phi: &[f64],
    ) -> Silhouette<S> {
        assert!(self.size.pixels() > 0, "an image needs at least one pixel");
        let Self { t_conorm, tolerance, culls, .. } = *self;
        let profile = Profile::new::<B, H>(&softness, t_conorm, phi, room, tolerance);
        let op = ProfileSum {
            faces: faces.clone(),
            culls,
            grid: profile.grid(),
            size: self.size,
            near: NEAR,
            kept: None,
            #[cfg(feature = "wgpu")]
            on_gpu: crate::gpu::SumOnGpu::new(t_conorm.is_like_depths()),
        };
        Silhouette { softness, profile, op }
    }
}

/// Soft silhouettes of one mesh topology under one softness, through the fused op.
#[derive(Clone, Debug)]
pub struct Silhouette<S> {
    softness: S,
    profile: Profile,
    op: ProfileSum,
}

impl<S: Softness> Silhouette<S> {
    /// Coverage `[views, height, width]` in [0, 1], top row first.
    ///
    /// `vertices` `[views, vertices, 3]` holds x and y in NDC and the camera depth, as
    /// [`project`](crate::project) returns them; `phi` `[parameters]` belongs to the softness. Both
    /// receive gradients, to second order on `Autodiff<Autodiff<B>>`.
    pub fn coverage<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        phi: Tensor<B, 1>,
    ) -> Tensor<B, 3> {
        self.coverage_by_table(vertices, self.table(phi))
    }

    /// The table of the softness, `[rows, 4]`: compute it once where `phi` does not change.
    pub fn table<B: Backend>(&self, phi: Tensor<B, 1>) -> Tensor<B, 2> {
        self.profile.table(&self.softness, phi)
    }

    /// The numbers of the table of plain parameters, computed on the CPU in f64, whatever it is drawn with: tables made in f32
    /// put a pixel off by 2e-5 under a Gamma law, and lose their curvature. A GPU gets it in one piece, instead of some sixty small kernels over a few
    /// hundred numbers.
    #[doc(hidden)]
    pub fn table_data(&self, phi: &[f64]) -> TensorData {
        self.table(precise::<HostBackend>(phi, &Default::default())).into_data()
    }

    /// Like [`Silhouette::coverage`], from a table `[rows, 4]`.
    pub fn coverage_by_table<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
    ) -> Tensor<B, 3> {
        covered(self.profile.t_conorm(), self.sums(vertices, table))
    }

    /// The [`mse_loss`](crate::mse_loss) of each view against a target `[1 or views, height, width]`, `[views]`: that of
    /// [`Silhouette::coverage_by_table`], times the share of each pixel that is `counted` (shaped like a target) unless all is, in one op on
    /// the CPU under the probabilistic sum. Gradients reach the vertices alone, to second order.
    ///
    /// # Panics
    ///
    /// If shapes or float types do not fit.
    pub fn mse_loss_by_table<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
        target: Tensor<B, 3>,
        counted: Option<Tensor<B, 3>>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::SquaredError, vertices, table, target, counted)
    }

    /// The [`iou_loss`](crate::iou_loss) of each view, likewise.
    ///
    /// # Panics
    ///
    /// If shapes or float types do not fit.
    pub fn iou_loss_by_table<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
        target: Tensor<B, 3>,
        counted: Option<Tensor<B, 3>>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::Iou, vertices, table, target, counted)
    }

    pub(crate) fn loss<B: RasterBackend>(
        &self,
        loss: PixelLoss,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
        target: Tensor<B, 3>,
        counted: Option<Tensor<B, 3>>,
    ) -> Tensor<B, 1> {
        // Detaching a leaf leaves its request for a gradient.
        let (table, target) = (constant(table), constant(target));
        let counted = counted.map(constant);
        if !B::ON_HOST || self.profile.t_conorm() != TConorm::Probabilistic {
            let coverage = self.coverage_by_table(vertices, table);
            return loss_of_images(loss, coverage, target, counted);
        }
        silhouette_loss(&self.op, loss, vertices, table, target, counted)
    }

    /// Sums over the faces of each pixel, `[views, height, width]`: what the T-conorm of the profile
    /// turns into coverage. Arguments are those of [`Silhouette::coverage_by_table`].
    #[doc(hidden)]
    pub fn sums<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
    ) -> Tensor<B, 3> {
        profile_sum(&self.op, vertices, table)
    }

    /// The op behind [`Silhouette::sums`], for callers that run it on slices.
    #[doc(hidden)]
    pub fn op(&self) -> FusedOp {
        FusedOp::ProfileSum(self.op.clone())
    }

    /// What draws with the softness stretched by `factor` along the distance, if it can be told from this.
    pub(crate) fn stretched(&self, factor: f64) -> Option<Self> {
        let profile = self.profile.stretched(factor)?;
        let op = ProfileSum { grid: profile.grid(), ..self.op.clone() };
        Some(Self { softness: self.softness.clone(), profile, op })
    }

    /// A silhouette of other faces.
    pub(crate) fn with_faces(&self, faces: Arc<[[u32; 3]]>) -> Self {
        let op = ProfileSum {
            faces,
            #[cfg(feature = "wgpu")]
            on_gpu: crate::gpu::SumOnGpu::new(self.profile.t_conorm().is_like_depths()),
            ..self.op.clone()
        };
        Self { op, ..self.clone() }
    }

    /// Which softness it is.
    pub(crate) fn softness(&self) -> &S {
        &self.softness
    }

    /// The same on images of another size: neither support nor knots depend on it.
    ///
    /// # Panics
    ///
    /// If the image is empty.
    #[must_use]
    pub fn sized(mut self, size: impl Into<ImageSize>) -> Self {
        self.op.size = size.into();
        assert!(self.op.size.pixels() > 0, "an image needs at least one pixel");
        self
    }

    /// Number of pixel-face pairs that culling leaves for `vertices` `[views, vertices, 3]`: what
    /// one pass over all views visits, forward or backward.
    #[doc(hidden)]
    pub fn pairs<B: Backend>(&self, vertices: Tensor<B, 3>) -> usize {
        pairs(&self.op, vertices)
    }

    /// The same support with `2^bits` cells in each octave of the squared distance, instead of as
    /// many as the tolerance asks for. For measuring what knots are worth: the bound of
    /// [`Profile::new`] does not hold for the result, and [`Profile::error`] is not measured anew.
    ///
    /// # Panics
    ///
    /// If `bits` is above 12.
    #[doc(hidden)]
    #[must_use]
    pub fn with_cells(mut self, bits: u32) -> Self {
        assert!(bits <= 12, "a table of 2^{bits} cells in an octave is too large");
        self.profile = self.profile.with_cells(bits);
        self.op.grid.bits = bits;
        self
    }

    /// Coverage with another function in the backward pass: the image is that of `self`, the
    /// gradient to the vertices is that of `surrogate` times the image's own `dA/dS`.
    ///
    /// This is a straight-through estimator: a sharp image with a wide gradient. What comes back is
    /// **not** the derivative of the image. Gradients reach the parameters of neither softness at the
    /// outermost level of autodiff. A step takes as many passes as without.
    ///
    /// Not in the paper. Source: docs/notes.md, Surrogate gradient.
    pub fn coverage_with_surrogate<B: RasterBackend, T: Softness>(
        &self,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
        surrogate: &Silhouette<T>,
        surrogate_table: Tensor<B, 2>,
    ) -> Tensor<B, 3> {
        let wide = (&surrogate.op, surrogate_table);
        let sums = straight_through_sum((&self.op, table), wide, vertices);
        covered(self.profile.t_conorm(), sums)
    }

    /// Support, knots and error of the table in use.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }
}

/// Coverage of sums, in one op for the T-conorm that most use.
fn covered<B: RasterBackend>(t_conorm: TConorm, sums: Tensor<B, 3>) -> Tensor<B, 3> {
    match t_conorm {
        TConorm::Probabilistic => elementary(ElementaryOp::Coverage, vec![primitive(sums)]),
        _ => t_conorm.coverage(sums),
    }
}

fn constant<B: RasterBackend, const D: usize>(tensor: Tensor<B, D>) -> Tensor<B, D> {
    tensor.detach().set_require_grad(false)
}
