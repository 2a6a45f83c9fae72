use std::sync::Arc;

use softrast_kernel::PixelLoss;
use softrast_softness::Softness;
use softrast_tensor::{Backend, Tensor, TensorData};

use crate::{
    HostBackend, ImageSize, NEAR, Profile, ProfileSum, RasterBackend, SilhouetteLoss, TConorm,
    backend::{elementary, pairs, primitive, silhouette_loss, straight_through_sum},
    curve::precise,
    loss::loss_of_images,
    ops::{ElementaryOp, FusedOp},
    profile_sum,
};

/// Settings of silhouettes.
///
/// The module [`low_level`](crate::low_level) has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rasterizer {
    /// Height and width of the image in pixels.
    pub size: ImageSize,
    /// Largest error of any pixel relative to evaluating every pixel-face pair; see [`Profile::new`].
    pub tolerance: f64,
    /// Aggregation of the coverages of several faces.
    pub t_conorm: TConorm,
    /// Whether back faces, whose corners appear clockwise to the camera, are culled.
    pub culls: bool,
}

impl Rasterizer {
    /// The default largest error of a pixel.
    pub const TOLERANCE: f64 = 1e-5;

    /// A rasterizer for images of `size` pixels, a square or `[height, width]`, with the probabilistic sum and the default tolerance.
    pub fn new(size: impl Into<ImageSize>) -> Self {
        let size = size.into();
        Self { size, tolerance: Self::TOLERANCE, t_conorm: TConorm::Probabilistic, culls: false }
    }

    /// Prepares silhouettes of meshes with these faces, for a softness near the parameters `phi`.
    ///
    /// The parameters only determine the support and the knots; they are read from the tensor once. Prepare again when they have moved so
    /// far that the support no longer fits.
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
            true => self.prepare_for::<B, B, S>(faces.len(), faces, softness, &values),
            // Without host-GPU transfers for every attempt.
            false => self.prepare_for::<B, HostBackend, S>(faces.len(), faces, softness, &values),
        }
    }

    /// [`Rasterizer::prepare`] from numbers, with knots for `room` faces, at least the number of faces. Support and knots are chosen on `H`,
    /// in f64 if it supports that.
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
            #[cfg(feature = "gpu")]
            on_gpu: crate::gpu::SumOnGpu::new(t_conorm.is_like_depths()),
        };
        Silhouette { softness, profile, op }
    }
}

/// Soft silhouettes of one mesh topology under one softness, through the fused op.
///
/// The module [`low_level`](crate::low_level) has an example.
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

    /// The table of the softness, `[rows, 4]`: compute it once if `phi` does not change.
    pub fn table<B: Backend>(&self, phi: Tensor<B, 1>) -> Tensor<B, 2> {
        self.profile.table(&self.softness, phi)
    }

    /// The numbers of the table for fixed parameters, computed on the CPU in f64, whatever backend draws: tables computed in f32 change a
    /// pixel by 2e-5 with a Gamma law, and lose their curvature. A GPU gets it in one upload, instead of some sixty small kernels over a
    /// few hundred numbers.
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

    /// The loss of each view of [`Silhouette::coverage_by_table`] relative to a target `[1 or views, height, width]`, `[views]`:
    /// [`mse_loss`](crate::mse_loss) or [`iou_loss`](crate::iou_loss). The coverage is multiplied by `counted` (shaped like a target) if
    /// given. On the CPU with the probabilistic sum it is one op. Gradients reach only the vertices, to second order.
    ///
    /// # Panics
    ///
    /// If shapes or float types do not fit.
    pub fn loss_by_table<B: RasterBackend>(
        &self,
        loss: PixelLoss,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
        target: Tensor<B, 3>,
        counted: Option<Tensor<B, 3>>,
    ) -> Tensor<B, 1> {
        // Detaching a leaf keeps its flag for a gradient.
        let (table, target) = (constant(table), constant(target));
        let counted = counted.map(constant);
        if !B::ON_HOST || self.profile.t_conorm() != TConorm::Probabilistic {
            let coverage = self.coverage_by_table(vertices, table);
            return loss_of_images(loss, coverage, target, counted);
        }
        silhouette_loss(&self.op, loss, vertices, table, target, counted)
    }

    /// Sums over the faces of each pixel, `[views, height, width]`, before the T-conorm of the profile turns them into coverage. Arguments
    /// are those of [`Silhouette::coverage_by_table`].
    #[doc(hidden)]
    pub fn sums<B: RasterBackend>(
        &self,
        vertices: Tensor<B, 3>,
        table: Tensor<B, 2>,
    ) -> Tensor<B, 3> {
        profile_sum(&self.op, vertices, table)
    }

    /// The op of the sums that coverage is computed from, for callers that run it on slices.
    pub fn op(&self) -> FusedOp {
        FusedOp::ProfileSum(self.op.clone())
    }

    /// The op of the losses of vertices, a table and a target, for callers that run it on slices. Only the probabilistic sum has one.
    pub fn loss_op(&self, loss: PixelLoss) -> Option<FusedOp> {
        (self.profile.t_conorm() == TConorm::Probabilistic).then(|| {
            let sum = self.op.clone();
            FusedOp::SilhouetteLoss(SilhouetteLoss { sum, loss, weighted: false, kept: None })
        })
    }

    /// The silhouette with the softness stretched by `factor` along the distance, if it can be derived from this one.
    pub(crate) fn stretched(&self, factor: f64) -> Option<Self> {
        let profile = self.profile.stretched(factor)?;
        let op = ProfileSum { grid: profile.grid(), ..self.op.clone() };
        Some(Self { softness: self.softness.clone(), profile, op })
    }

    /// A silhouette of other faces.
    pub(crate) fn with_faces(&self, faces: Arc<[[u32; 3]]>) -> Self {
        let op = ProfileSum {
            faces,
            #[cfg(feature = "gpu")]
            on_gpu: crate::gpu::SumOnGpu::new(self.profile.t_conorm().is_like_depths()),
            ..self.op.clone()
        };
        Self { op, ..self.clone() }
    }

    /// The softness.
    pub(crate) fn softness(&self) -> &S {
        &self.softness
    }

    /// This silhouette on images of another size: neither support nor knots depend on it.
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

    /// Number of pixel-face pairs after culling for `vertices` `[views, vertices, 3]`: one pass over all views visits them, forward or
    /// backward.
    #[doc(hidden)]
    pub fn pairs<B: Backend>(&self, vertices: Tensor<B, 3>) -> usize {
        pairs(&self.op, vertices)
    }

    /// This silhouette with `2^bits` cells per octave of the squared distance in the same support, instead of the number required by the
    /// tolerance. For measuring the effect of knots: the bound of [`Profile::new`] does not hold for the result, and [`Profile::error`] is
    /// not updated.
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

    /// Coverage with a surrogate gradient: the image is that of `self`, the gradient with respect to the vertices is that of `surrogate`
    /// times the image's own `dA/dS`.
    ///
    /// This is a straight-through estimator: a sharp image with the gradient of a wider softness. The result of the backward pass is **not**
    /// the derivative of the image. Gradients reach the parameters of neither softness at the outermost level of autodiff. A step takes as
    /// many passes as without.
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

    /// Support, knots and error of the current table.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }
}

/// Coverage of sums, in one op for the most common T-conorm.
fn covered<B: RasterBackend>(t_conorm: TConorm, sums: Tensor<B, 3>) -> Tensor<B, 3> {
    match t_conorm {
        TConorm::Probabilistic => elementary(ElementaryOp::Coverage, vec![primitive(sums)]),
        _ => t_conorm.coverage(sums),
    }
}

fn constant<B: RasterBackend, const D: usize>(tensor: Tensor<B, D>) -> Tensor<B, D> {
    tensor.detach().set_require_grad(false)
}
