use std::{cell::RefCell, collections::BTreeMap, sync::Arc};

use softrast_raster::{
    ColourRenderer, ImageSize, Projected, RasterBackend, SoftRenderer, Weighting,
    low_level::{PixelLoss, Rasterizer},
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Softness};
use softrast_tensor::{Tensor, numbers, vector};

use crate::{PhiLayout, Resolution, ScheduledSoftness, Targets};

/// Draws soft silhouettes of one mesh topology at every step of a run.
///
/// Support and knots follow the softness as in a [`SoftRenderer`]. They are cached for every step, with the tables of
/// steps without a gradient with respect to φ, because many runs under one softness use them again.
///
/// ```
/// use softrast_inverse::{PhiLayout, Resolution, ScheduledRenderer, ScheduledSoftness, SoftnessAt};
/// use softrast_raster::{HostBackend, Projected, low_level::Rasterizer, vertex_tensor};
/// use softrast_softness::{EdgeSoftness, Family};
/// use softrast_tensor::numbers;
///
/// let narrowing = ScheduledSoftness::decay(EdgeSoftness::new(Family::Logistic), 0.5, 0.01);
/// let layout = PhiLayout::new(narrowing, Vec::new(), 10, 8);
/// let (phi, faces) = (layout.start(), Some([[0, 1, 2]].into()));
/// let renderer = ScheduledRenderer::new(layout, &phi, Rasterizer::new(8), Resolution::Full, faces);
/// let corners = [[-0.5, -0.5, 1.0], [0.5, -0.5, 1.0], [0.0, 0.5, 1.0]];
/// let corners = Projected::new(vertex_tensor::<HostBackend>(&corners, &Default::default()));
/// let [first, last] = [0, 9].map(|step| {
///     let softness: SoftnessAt<'_, HostBackend> = renderer.at(step);
///     numbers(softness.silhouette(corners.clone()))
/// });
/// assert!(first[0] > 0.05 && last[0] < 1e-3);
/// ```
#[derive(Debug)]
pub struct ScheduledRenderer<S = EdgeSoftness> {
    layout: PhiLayout<S>,
    phi: Vec<f64>,
    /// The softness if nothing is differentiated with respect to φ.
    values: ScheduledSoftness<S>,
    own: Vec<f64>,
    size: ImageSize,
    tolerance: f64,
    resolution: Resolution,
    /// Renderer of silhouettes, if the problem has any.
    renderer: Option<SoftRenderer<S>>,
    /// Renderers by progress drawn so far, each with its table.
    placed: RefCell<BTreeMap<u64, SoftRenderer<S>>>,
    /// The latest renderer of colours.
    colours: RefCell<Option<Colours<S>>>,
}

/// A renderer of colours, the faces that it draws, and the size of its images.
#[derive(Debug)]
struct Colours<S> {
    faces: Arc<[[u32; 3]]>,
    size: ImageSize,
    renderer: ColourRenderer<S>,
}

impl<S: Softness> ScheduledRenderer<S> {
    /// A renderer with the softness of the vector `phi` in this layout, at the size of the rasterizer or a lower
    /// resolution. Without `faces` it draws nothing and only provides parameters.
    pub fn new(
        layout: PhiLayout<S>,
        phi: &[f64],
        rasterizer: Rasterizer,
        resolution: Resolution,
        faces: Option<Arc<[[u32; 3]]>>,
    ) -> Self {
        let (values, own) = layout.softness(phi);
        let renderer = faces.map(|faces| values.renderer_at(0.0, rasterizer, faces));
        let (size, tolerance) = (rasterizer.size, rasterizer.tolerance);
        let phi = phi.to_vec();
        let (placed, colours) = (RefCell::default(), RefCell::default());
        Self { layout, phi, values, own, size, tolerance, resolution, renderer, placed, colours }
    }

    /// The softness at a step, not differentiated with respect to φ.
    pub fn at<B: RasterBackend>(&self, step: usize) -> SoftnessAt<'_, B, S> {
        self.at_progress(self.layout.progress(step))
    }

    /// The softness at this progress of a run, 0 to 1, not differentiated with respect to φ.
    pub(crate) fn at_progress<B: RasterBackend>(&self, progress: f64) -> SoftnessAt<'_, B, S> {
        SoftnessAt { renderer: self, progress, prepared: None }
    }

    /// The softness at a step from the result of [`ScheduledRenderer::prepared`].
    pub(crate) fn of_prepared<B: RasterBackend>(
        &self,
        step: usize,
        prepared: Tensor<B, 1>,
    ) -> SoftnessAt<'_, B, S> {
        SoftnessAt { prepared: Some(prepared), ..self.at(step) }
    }

    /// The inputs of the image at a step, computed from the vector `phi` `[P]`, flat: the table for silhouettes, else parameters.
    pub(crate) fn prepared<B: RasterBackend>(
        &self,
        phi: &Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1> {
        let step = step.min(self.layout.steps());
        if self.renderer.is_none() {
            let parts = [self.layout.phi(phi, step), self.layout.own(phi)];
            return Tensor::cat(parts.into_iter().filter(|part| part.dims() != [0]).collect(), 0);
        }
        let renderer = self.silhouettes::<B>(self.layout.progress(step));
        let own = [Some(&renderer), renderer.surrogate()].into_iter().flatten();
        let phi = [self.layout.phi(phi, step)].into_iter().chain(self.layout.surrogate(phi, step));
        // Uses the knots of the values: nothing is read from the device.
        let table = |(of, phi): (&SoftRenderer<S>, _)| of.prepared::<B>(of.phi()).table(phi);
        let tables = own.zip(phi).map(|both| table(both).flatten(0, 1));
        Tensor::cat(tables.collect(), 0)
    }

    /// The vector that it was made for.
    pub(crate) fn phi(&self) -> &[f64] {
        &self.phi
    }

    /// Whether `phi` `[P]` equals the vector that it was made for, up to its float type.
    pub(crate) fn is_of<B: RasterBackend>(&self, phi: &Tensor<B, 1>) -> bool {
        let own = numbers(vector::<B>(&self.phi));
        numbers(phi.clone()) == own
    }

    /// The layout of the vector.
    pub fn layout(&self) -> &PhiLayout<S> {
        &self.layout
    }

    /// Scale of the softness at this progress of a run.
    pub(crate) fn scale(&self, progress: f64) -> f64 {
        self.values.scale_at(progress, self.layout.size())
    }

    /// A key of the progress; equal keys have the same softness.
    fn place(&self, progress: f64) -> u64 {
        if self.values.is_constant() { 0 } else { progress.to_bits() }
    }

    /// Size of the image at this progress.
    fn size(&self, progress: f64) -> ImageSize {
        self.resolution.size(self.size, self.values.width_at(progress, self.layout.size()))
    }

    /// The renderer of silhouettes at this progress.
    ///
    /// # Panics
    ///
    /// If the problem has no faces.
    fn silhouettes<B: RasterBackend>(&self, progress: f64) -> SoftRenderer<S> {
        let renderer = self.renderer.as_ref().expect("a problem that sees silhouettes has faces");
        let mut placed = self.placed.borrow_mut();
        let placed = placed.entry(self.place(progress)).or_insert_with(|| {
            let size = self.layout.size();
            let surrogate = self.values.surrogate_at(progress, size).map(|found| found.phi);
            renderer.with_phi::<B>(self.values.phi_at(progress, size), surrogate)
        });
        placed.sized(self.size(progress))
    }
}

/// The softness at one progress of a run, as passed to [`InverseProblem::image`](crate::InverseProblem::image).
///
/// [`ScheduledRenderer`] has an example.
#[derive(Clone, Debug)]
pub struct SoftnessAt<'a, B: RasterBackend, S = EdgeSoftness> {
    renderer: &'a ScheduledRenderer<S>,
    /// Progress of the run, 0 to 1.
    progress: f64,
    /// The result of `prepared` for a vector φ; without it, the renderer's own values are used.
    prepared: Option<Tensor<B, 1>>,
}

impl<'a, B: RasterBackend, S: Softness> SoftnessAt<'a, B, S> {
    /// Coverage `[views, height, width]` of `vertices` `[views, vertices, 3]` (x and y in NDC, depth), with the gradient
    /// of the surrogate if there is one, on images of [`size`](Self::size).
    ///
    /// # Panics
    ///
    /// If the problem has no faces.
    pub fn silhouette(&self, vertices: Projected<B>) -> Tensor<B, 3> {
        let renderer = self.renderer.silhouettes::<B>(self.progress);
        let Some(prepared) = &self.prepared else { return renderer.silhouette(vertices) };
        let (seen, table) = (renderer.prepared::<B>(renderer.phi()), prepared.clone());
        let (vertices, table) = (vertices.tensor(), table.reshape([-1, 4]));
        let Some(surrogate) = renderer.surrogate() else {
            return seen.coverage_by_table(vertices, table);
        };
        let ([rows, _], own) = (table.dims(), seen.profile().knots());
        let below = table.clone().narrow(0, own, rows - own);
        let surrogate = surrogate.prepared::<B>(surrogate.phi());
        seen.coverage_with_surrogate(vertices, table.narrow(0, 0, own), &surrogate, below)
    }

    /// The [`Targets::iou_loss`] `[views]` of the [`silhouette`](Self::silhouette): as one op if
    /// nothing is differentiated with respect to φ and there is no surrogate.
    ///
    /// # Panics
    ///
    /// If the problem has no faces, or there is no target of this size.
    pub fn iou_loss(&self, vertices: Projected<B>, targets: &Targets<B>) -> Tensor<B, 1> {
        if self.prepared.is_some() {
            return targets.iou_loss(self.silhouette(vertices));
        }
        let (target, counted) = targets.at(self.size());
        let renderer = self.renderer.silhouettes::<B>(self.progress);
        renderer.weighted_loss(PixelLoss::Iou, vertices, target, counted)
    }

    /// The [`Targets::mse_loss`] `[views]` of the silhouette, as one op as for `iou_loss`.
    ///
    /// # Panics
    ///
    /// If the problem has no faces, or there is no target of this size.
    pub fn mse_loss(&self, vertices: Projected<B>, targets: &Targets<B>) -> Tensor<B, 1> {
        if self.prepared.is_some() {
            return targets.mse_loss(self.silhouette(vertices));
        }
        let (target, counted) = targets.at(self.size());
        let renderer = self.renderer.silhouettes::<B>(self.progress);
        renderer.weighted_loss(PixelLoss::SquaredError, vertices, target, counted)
    }

    /// Size of the image: that of the problem or smaller, by the resolution.
    pub fn size(&self) -> ImageSize {
        self.renderer.size(self.progress)
    }

    /// Largest error of a pixel from culling distant faces.
    pub fn tolerance(&self) -> f64 {
        self.renderer.tolerance
    }

    /// The softness of edges and its parameters `[P]`.
    pub fn edge(&self) -> (&'a S, Tensor<B, 1>) {
        let ScheduledRenderer { layout, values, .. } = self.renderer;
        let phi = match &self.prepared {
            Some(prepared) => prepared.clone().narrow(0, 0, values.phi.len()),
            None => vector(&values.phi_at(self.progress, layout.size())),
        };
        (layout.edge(), phi)
    }

    /// A renderer of these faces in colours under this softness of edges, on images of [`size`](Self::size).
    ///
    /// `planes` are the depths of nearness 1 and 0 in world units, `depth_scale` is in units of the distance between them. The tables of
    /// the latest renderer are cached for the next call with equal arguments. [`ColourRenderer::image_with`] passes gradients on to φ,
    /// under the parameters of [`edge`](Self::edge).
    ///
    /// # Panics
    ///
    /// If there is no face, the planes do not ascend, or the scale is not positive.
    pub fn colour_renderer(
        &self,
        faces: &Arc<[[u32; 3]]>,
        planes: [f64; 2],
        depth: DepthSoftness,
        depth_scale: f64,
    ) -> ColourRenderer<S> {
        let ((edge, phi), size) = (self.edge(), self.size());
        let phi = [numbers(phi), depth.default_phi(depth_scale)];
        let same = |kept: &Colours<S>| {
            let of = kept.renderer.weighting();
            let drawn = kept.size == size && kept.faces == *faces;
            drawn && of.depth == depth && of.planes == planes
        };
        let mut colours = self.renderer.colours.borrow_mut();
        let mut renderer = match colours.take().filter(same) {
            Some(kept) => kept.renderer,
            None => {
                let weighting = Weighting { edge: edge.clone(), depth, planes };
                ColourRenderer::with_weighting(faces.clone(), size, weighting, phi.clone())
                    .with_tolerance(self.tolerance())
            }
        };
        renderer.set_phi(phi);
        colours.insert(Colours { faces: faces.clone(), size, renderer }).renderer.clone()
    }

    /// The problem's own parameters, `[P]`.
    pub fn own(&self) -> Tensor<B, 1> {
        match &self.prepared {
            Some(prepared) => self.renderer.layout.own(prepared),
            None => vector(&self.renderer.own),
        }
    }

    /// A key of the softness at this progress, if nothing is differentiated with respect to φ:
    /// values that depend on the softness alone may be cached under it.
    pub fn fixed_place(&self) -> Option<u64> {
        self.prepared.is_none().then(|| self.renderer.place(self.progress))
    }
}
