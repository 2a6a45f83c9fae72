use std::{cell::RefCell, collections::BTreeMap, sync::Arc};

use burn::tensor::{Element, Tensor, TensorData};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette, SoftRenderer};
use softrast_softness::{EdgeSoftness, ScheduledSoftness, numbers, tensor, vector};

use crate::{PhiLayout, Resolution};

/// Draws soft silhouettes of one mesh topology at every step of a run.
///
/// Support and knots follow the softness as in a [`SoftRenderer`]. Tables of steps without a gradient to φ are kept.
#[derive(Debug)]
pub struct ScheduledRenderer {
    layout: PhiLayout,
    /// The vector that it was made for.
    phi: Vec<f64>,
    /// What is drawn where nothing is differentiated by φ.
    values: ScheduledSoftness,
    own: Vec<f64>,
    size: usize,
    resolution: Resolution,
    /// What draws silhouettes, if the problem has any: as they are seen, and as their gradient has it, if that is another.
    renderers: Option<(Edges, Option<Edges>)>,
    /// What was drawn with so far, by [`PhiLayout::stage`].
    silhouettes: RefCell<BTreeMap<usize, Silhouettes>>,
    /// Tables of the values, by stage.
    tables: RefCell<BTreeMap<usize, TensorData>>,
}

type Edges = SoftRenderer<EdgeSoftness>;

/// Silhouettes as they are seen, and those whose gradient stands for theirs, if there are such.
#[derive(Clone, Debug)]
struct Silhouettes {
    seen: Silhouette<EdgeSoftness>,
    surrogate: Option<Silhouette<EdgeSoftness>>,
}

impl ScheduledRenderer {
    /// Draws with the softness that the vector `phi` stands for, as the layout has it, at the size of the rasterizer or a lower
    /// resolution. Without `faces` it draws nothing and only gives parameters.
    pub fn new(
        layout: PhiLayout,
        phi: &[f64],
        rasterizer: Rasterizer,
        resolution: Resolution,
        faces: Option<Arc<[[u32; 3]]>>,
    ) -> Self {
        let (values, own) = layout.softness(phi);
        let renderers = faces.map(|faces| {
            let of = |softness, phi| {
                SoftRenderer::with_rasterizer(rasterizer, faces.clone(), softness, phi)
            };
            let surrogate = values.surrogate.clone().map(|found| of(found.softness, found.phi));
            (of(values.softness, values.phi.clone()), surrogate)
        });
        let (silhouettes, tables) = Default::default();
        let size = rasterizer.size;
        let phi = phi.to_vec();
        Self { layout, phi, values, own, size, resolution, renderers, silhouettes, tables }
    }

    /// The softness at a step of which nothing is differentiated by φ.
    pub fn at<B: RasterBackend>(&self, step: usize) -> SoftnessAt<'_, B> {
        SoftnessAt { renderer: self, step: step.min(self.layout.steps()), phi: Phi::Fixed }
    }

    /// The softness at a step by a vector `phi` `[P]` that may be tracked.
    pub(crate) fn tracked<B: RasterBackend>(
        &self,
        step: usize,
        phi: Tensor<B, 1>,
    ) -> SoftnessAt<'_, B> {
        SoftnessAt { renderer: self, step: step.min(self.layout.steps()), phi: Phi::Tracked(phi) }
    }

    /// The softness at a step from what [`ScheduledRenderer::prepare`] gave.
    pub(crate) fn of_prepared<B: RasterBackend>(
        &self,
        step: usize,
        prepared: Tensor<B, 1>,
    ) -> SoftnessAt<'_, B> {
        let phi = Phi::Prepared(prepared);
        SoftnessAt { renderer: self, step: step.min(self.layout.steps()), phi }
    }

    /// All that the image at a step needs of the vector `phi` `[P]`, flat: the table where silhouettes are drawn, else parameters.
    pub(crate) fn prepare<B: RasterBackend>(
        &self,
        phi: &Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1> {
        let step = step.min(self.layout.steps());
        match &self.renderers {
            Some(_) => self.table(&self.silhouettes::<B>(step), phi, step).flatten(0, 1),
            None => {
                let parts = [self.layout.phi(phi, step), self.layout.own(phi)];
                Tensor::cat(parts.into_iter().filter(|part| part.dims() != [0]).collect(), 0)
            }
        }
    }

    /// Whether these are the numbers that it was made for, as far as the float type of `phi` `[P]` can tell.
    pub(crate) fn is_of<B: RasterBackend>(&self, phi: &Tensor<B, 1>) -> bool {
        let own = numbers(vector::<B>(&self.phi));
        numbers(phi.clone()) == own
    }

    /// How the vector is laid out.
    pub fn layout(&self) -> &PhiLayout {
        &self.layout
    }

    /// Scale of the softness at a step.
    pub fn scale(&self, step: usize) -> f64 {
        self.values.scale_at(self.layout.part(step), self.layout.size())
    }

    /// Pixels a side of the image at a step.
    pub fn side(&self, step: usize) -> usize {
        let width = self.values.width_at(self.layout.part(step), self.layout.size());
        self.resolution.side(self.size, width)
    }

    /// What draws at a step, always the same: tables belong to its knots.
    ///
    /// # Panics
    ///
    /// If the problem has no faces.
    fn silhouettes<B: RasterBackend>(&self, step: usize) -> Silhouettes {
        let mut kept = self.silhouettes.borrow_mut();
        let silhouettes = kept.entry(self.layout.stage(step)).or_insert_with(|| {
            let renderers = self.renderers.as_ref();
            let (seen, surrogate) = renderers.expect("a problem that sees silhouettes has faces");
            let (part, size) = (self.layout.part(step), self.layout.size());
            let other = surrogate.as_ref().zip(self.values.surrogate_at(part, size));
            Silhouettes {
                seen: seen.prepared::<B>(&self.values.phi_at(part, size)),
                surrogate: other.map(|(renderer, found)| renderer.prepared::<B>(&found.phi)),
            }
        });
        silhouettes.clone()
    }

    /// The table of a step `[rows, 4]`, and below it that of the surrogate.
    fn table<B: RasterBackend>(
        &self,
        Silhouettes { seen, surrogate }: &Silhouettes,
        phi: &Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 2> {
        let table = seen.table(self.layout.phi(phi, step));
        match surrogate.iter().zip(self.layout.surrogate(phi, step)).next() {
            None => table,
            Some((surrogate, (_, phi))) => Tensor::cat(vec![table, surrogate.table(phi)], 0),
        }
    }

    /// The table of the values.
    fn fixed_table<B: RasterBackend>(
        &self,
        Silhouettes { seen, surrogate }: &Silhouettes,
        step: usize,
    ) -> Tensor<B, 2> {
        let dtype = <B::FloatElem as Element>::dtype();
        let mut tables = self.tables.borrow_mut();
        let table = tables.entry(self.layout.stage(step)).or_insert_with(|| {
            let (part, size) = (self.layout.part(step), self.layout.size());
            let own = (seen, self.values.phi_at(part, size));
            let other = surrogate.iter().zip(self.values.surrogate_at(part, size));
            let pairs = [own].into_iter().chain(other.map(|(of, found)| (of, found.phi)));
            let tables = pairs
                .map(|(of, phi)| of.table_data::<B>(&phi, dtype).iter::<f64>().collect::<Vec<_>>());
            let values = tables.collect::<Vec<_>>().concat();
            let rows = values.len() / 4;
            TensorData::new(values, [rows, 4])
        });
        Tensor::from_data(table.clone(), (&Default::default(), dtype))
    }
}

/// The softness at one step of a run, as [`InverseProblem::image`](crate::InverseProblem::image) sees it.
#[derive(Clone, Debug)]
pub struct SoftnessAt<'a, B: RasterBackend> {
    renderer: &'a ScheduledRenderer,
    step: usize,
    phi: Phi<B>,
}

/// What stands for the softness.
#[derive(Clone, Debug)]
enum Phi<B: RasterBackend> {
    /// The renderer's own values.
    Fixed,
    /// A vector, which may be tracked.
    Tracked(Tensor<B, 1>),
    /// What was prepared of one.
    Prepared(Tensor<B, 1>),
}

impl<B: RasterBackend> SoftnessAt<'_, B> {
    /// Coverage `[views, side, side]` of `vertices` `[views, vertices, 3]` (x and y in NDC, depth), with the gradient of the surrogate if
    /// there is one; the side is the size of the image or fewer pixels, as the resolution has it.
    ///
    /// # Panics
    ///
    /// If the problem has no faces.
    pub fn silhouette(&self, vertices: Tensor<B, 3>) -> Tensor<B, 3> {
        let renderer = self.renderer;
        let silhouettes = renderer.silhouettes::<B>(self.step);
        let table = match &self.phi {
            Phi::Fixed => renderer.fixed_table(&silhouettes, self.step),
            Phi::Tracked(phi) => renderer.table(&silhouettes, phi, self.step),
            Phi::Prepared(table) => table.clone().reshape([-1, 4]),
        };
        let Silhouettes { seen, surrogate } = silhouettes;
        let side = renderer.side(self.step);
        let seen = seen.sized(side);
        let Some(surrogate) = surrogate else { return seen.coverage_by_table(vertices, table) };
        let ([rows, _], own) = (table.dims(), seen.profile().knots());
        let below = table.clone().narrow(0, own, rows - own);
        let surrogate = surrogate.sized(side);
        seen.coverage_with_surrogate(vertices, table.narrow(0, 0, own), &surrogate, below)
    }

    /// The softness of edges and its parameters `[P]`.
    pub fn edge(&self) -> (EdgeSoftness, Tensor<B, 1>) {
        let ScheduledRenderer { layout, values, .. } = self.renderer;
        let phi = match &self.phi {
            Phi::Fixed => vector(&values.phi_at(layout.part(self.step), layout.size())),
            Phi::Tracked(phi) => layout.phi(phi, self.step),
            Phi::Prepared(prepared) => prepared.clone().narrow(0, 0, values.phi.len()),
        };
        (layout.edge(), phi)
    }

    /// Parameters of the problem's own, `[P]`.
    pub fn own(&self) -> Tensor<B, 1> {
        match &self.phi {
            Phi::Fixed => {
                let own = &self.renderer.own;
                tensor(own.clone(), [own.len()])
            }
            Phi::Tracked(phi) | Phi::Prepared(phi) => self.renderer.layout.own(phi),
        }
    }

    /// The number of the stage, where nothing is differentiated by φ: what follows from the softness alone may be kept as long as it
    /// is the same.
    pub fn fixed_stage(&self) -> Option<usize> {
        matches!(self.phi, Phi::Fixed).then(|| self.renderer.layout.stage(self.step))
    }
}
