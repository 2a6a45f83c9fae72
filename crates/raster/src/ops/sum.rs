use std::sync::{Arc, OnceLock};

use softrast_kernel::{Bands, Grid, Inputs, Kernels, bands_of_view};
use softrast_tensor::{Element, TensorData};

use crate::{
    ImageSize,
    ops::{elementary::flat, pass::Pass},
};

/// Constants of the op over its calls: faces, image size and the layout of the table.
///
/// The module [`low_level`](crate::low_level) has an example.
#[derive(Clone, Debug)]
pub struct ProfileSum {
    pub(crate) faces: Arc<[[u32; 3]]>,
    pub(crate) grid: Grid,
    pub(crate) size: ImageSize,
    pub(crate) near: f64,
    /// Whether back faces are culled.
    pub(crate) culls: bool,
    /// Cache between the forward pass and the backward passes of a recorded op: the faces of each row, 20 bytes per face and view.
    pub(crate) kept: Option<Arc<OnceLock<Bands>>>,
    #[cfg(feature = "gpu")]
    pub(crate) on_gpu: crate::gpu::SumOnGpu,
}

impl ProfileSum {
    /// The op of a call whose passes share a cache.
    pub(crate) fn keeping(&self) -> Self {
        Self {
            kept: Some(self.kept.clone().unwrap_or_default()),
            #[cfg(feature = "gpu")]
            on_gpu: self.on_gpu.keeping(),
            ..self.clone()
        }
    }

    pub(crate) fn inputs<'a, F>(
        &'a self,
        views: usize,
        vertices: &'a [F],
        table: &'a [F],
    ) -> Inputs<'a, F> {
        Inputs {
            vertices,
            table,
            faces: &self.faces,
            grid: self.grid,
            size: self.size,
            near: self.near,
            culls: self.culls,
            views,
            bands: bands_of_view(views, self.size),
        }
    }

    /// A pass over `vertices` `[views, 3, vertices]` (x and y in NDC, depth in world units) and a `table` `[rows, 4]`, to sums
    /// `[views, height, width]`, top row first.
    pub(crate) fn run<F: Kernels + Element>(
        &self,
        pass: &Pass,
        slices: &[&[F]],
        dims: &[Vec<usize>],
    ) -> TensorData {
        let views = dims[0][0];
        let inputs = self.inputs(views, slices[0], slices[1]);
        let own = OnceLock::new();
        let bands = self.kept.as_deref().unwrap_or(&own).get_or_init(|| F::bands(&inputs));
        let values = match pass {
            Pass::Forward => {
                return TensorData::new(
                    F::sums(&inputs, bands),
                    [views, self.size.height, self.size.width],
                );
            }
            Pass::Vjp { wanted } => F::sums_vjp(&inputs, bands, slices[2], [wanted[0], wanted[1]]),
            Pass::VjpOfVjp { along, wanted } => {
                let wanted = [wanted[0], wanted[1], wanted[2]];
                let along = [along[0], along[1]];
                F::sums_vjp_of_vjp(&inputs, bands, slices[2], slices[3], along, wanted)
            }
        };
        flat(values)
    }
}
