use std::{
    cell::{OnceCell, RefCell},
    collections::BTreeMap,
    sync::Arc,
};

use burn::tensor::{DType, Element, Tensor, TensorData};
use softrast_meta::{numbers, tensor, vector};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer, Silhouette};
use softrast_softness::{EdgeSoftness, ScheduledSoftness, Surrogate};

use crate::{PhiLayout, Resolution};

/// A scale may fall by this factor before support and knots are chosen anew.
const STALE: f64 = 0.95;

/// Draws soft silhouettes of one mesh topology at every step of a run.
///
/// Support and knots are chosen for a step when it is first drawn, and serve the steps after it for as long as the scale has not fallen
/// by 5 %. Tables of steps without a gradient to φ are kept.
#[derive(Debug)]
pub struct ScheduledRenderer {
    layout: PhiLayout,
    /// What is drawn where nothing is differentiated by φ.
    values: ScheduledSoftness,
    own: Vec<f64>,
    rasterizer: Rasterizer,
    resolution: Resolution,
    faces: Option<Arc<[[u32; 3]]>>,
    /// Of each step the first one that has its support and knots.
    prepared_at: Vec<usize>,
    prepared: BTreeMap<usize, OnceCell<Silhouettes>>,
    /// Tables of the values, by [`PhiLayout::stage`].
    tables: RefCell<BTreeMap<usize, TensorData>>,
}

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
        let mut prepared_at = Vec::with_capacity(layout.steps() + 1);
        let (mut first, mut prepared) = (0, f64::NAN);
        for step in 0..=layout.steps() {
            let scale = match &values.schedule {
                None => 1.0,
                Some(_) => values.scale_at(layout.part(step), layout.size()),
            };
            // Not a number at first, which is in no range.
            if !(STALE..=1.0).contains(&(scale / prepared)) {
                (first, prepared) = (step, scale);
            }
            prepared_at.push(first);
        }
        let cells = prepared_at.iter().map(|&first| (first, OnceCell::new())).collect();
        let (prepared, tables) = (cells, RefCell::default());
        Self { layout, values, own, rasterizer, resolution, faces, prepared_at, prepared, tables }
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
        match &self.faces {
            Some(faces) => self.table(faces, phi, step).flatten(0, 1),
            None => {
                let parts = [self.layout.phi(phi, step), self.layout.own(phi)];
                Tensor::cat(parts.into_iter().filter(|part| part.dims() != [0]).collect(), 0)
            }
        }
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
        self.resolution.side(self.rasterizer.size, width)
    }

    fn silhouettes<B: RasterBackend>(&self, faces: &Arc<[[u32; 3]]>, step: usize) -> &Silhouettes {
        let first = self.prepared_at[step];
        self.prepared[&first].get_or_init(|| {
            let part = self.layout.part(first);
            let size = self.layout.size();
            let prepared = |softness: EdgeSoftness, phi: &[f64]| {
                self.rasterizer.prepare_on::<HostBackend, _>(faces, softness, phi, B::ON_HOST)
            };
            let surrogate = self.values.surrogate_at(part, size);
            Silhouettes {
                seen: prepared(self.layout.edge(), &self.values.phi_at(part, size)),
                surrogate: surrogate.map(|Surrogate { softness, phi }| prepared(softness, &phi)),
            }
        })
    }

    /// The table of a step `[rows, 4]`, and below it that of the surrogate.
    fn table<B: RasterBackend>(
        &self,
        faces: &Arc<[[u32; 3]]>,
        phi: &Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 2> {
        let Silhouettes { seen, surrogate } = self.silhouettes::<B>(faces, step);
        let table = seen.table(self.layout.phi(phi, step));
        match surrogate.iter().zip(self.layout.surrogate(phi, step)).next() {
            None => table,
            Some((surrogate, (_, phi))) => Tensor::cat(vec![table, surrogate.table(phi)], 0),
        }
    }

    /// The table of the values.
    ///
    /// For a GPU it is computed on the CPU in f64: the GPU then gets it in one piece, instead of some sixty small kernels over a few
    /// hundred numbers, and its curvature is not lost to rounding.
    fn fixed_table<B: RasterBackend>(&self, faces: &Arc<[[u32; 3]]>, step: usize) -> Tensor<B, 2> {
        let mut tables = self.tables.borrow_mut();
        let table = tables.entry(self.layout.stage(step)).or_insert_with(|| {
            let (part, size) = (self.layout.part(step), self.layout.size());
            let (phi, surrogate) =
                (self.values.phi_at(part, size), self.values.surrogate_at(part, size));
            let Silhouettes { seen, surrogate: other } = self.silhouettes::<B>(faces, step);
            let pairs = [(seen, phi)].into_iter().chain(other.iter().zip(surrogate.map(|s| s.phi)));
            let tables: Vec<Vec<f64>> =
                pairs.map(|(of, phi)| table_values::<B>(of, &phi)).collect();
            let values = tables.concat();
            let rows = values.len() / 4;
            TensorData::new(values, [rows, 4])
        });
        let dtype = <B::FloatElem as Element>::dtype();
        Tensor::from_data(table.clone(), (&Default::default(), dtype))
    }
}

/// Numbers of the table of a softness, for drawing on `B`.
fn table_values<B: RasterBackend>(of: &Silhouette<EdgeSoftness>, phi: &[f64]) -> Vec<f64> {
    let dtype = if B::ON_HOST { <B::FloatElem as Element>::dtype() } else { DType::F64 };
    let data = TensorData::new(phi.to_vec(), [phi.len()]);
    numbers(of.table(Tensor::<HostBackend, 1>::from_data(data, (&Default::default(), dtype))))
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
        let faces = renderer.faces.as_ref().expect("a problem that sees silhouettes has faces");
        let table = match &self.phi {
            Phi::Fixed => renderer.fixed_table(faces, self.step),
            Phi::Tracked(phi) => renderer.table(faces, phi, self.step),
            Phi::Prepared(table) => table.clone().reshape([-1, 4]),
        };
        let Silhouettes { seen, surrogate } = renderer.silhouettes::<B>(faces, self.step);
        let side = renderer.side(self.step);
        let seen = seen.clone().sized(side);
        let Some(surrogate) = surrogate else { return seen.coverage_by_table(vertices, table) };
        let ([rows, _], own) = (table.dims(), seen.profile().knots());
        let below = table.clone().narrow(0, own, rows - own);
        let surrogate = surrogate.clone().sized(side);
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
