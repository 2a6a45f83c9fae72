use std::{
    any::Any,
    sync::{Arc, OnceLock},
};

use softrast_kernel::{
    Grid, Kernels,
    blend::{DepthGrid, Inputs, Kept},
};
use softrast_tensor::{Element, TensorData};

use crate::{
    ImageSize, NEAR,
    ops::{elementary::flat, pass::Pass},
    weighting::FARTHEST_SEEN,
};

/// Constants of the op over its calls: faces, image size, the layout of the tables, and the tolerance of culling.
#[derive(Clone, Debug)]
pub struct SoftBlend {
    pub(crate) faces: Arc<[[u32; 3]]>,
    pub(crate) entries: Arc<[[u32; 3]]>,
    /// Rows and columns of the texture, if there is one.
    pub(crate) texture: Option<[usize; 2]>,
    pub(crate) edge: Grid,
    pub(crate) depth: DepthGrid,
    pub(crate) floor: f64,
    pub(crate) planes: [f64; 2],
    pub(crate) size: ImageSize,
    /// Bound of the sum of all weights culled at a pixel, relative to the background's weight.
    pub(crate) tolerance: f64,
    /// Whether back faces are culled.
    pub(crate) culls: bool,
    /// Cache between the forward pass and the backward passes of a recorded op: the faces of each row, 28 bytes per face and view, and the
    /// sums of each pixel: channels and share rounded up to fours, and one number more. Its type is that of the floats.
    pub(crate) kept: Option<Arc<OnceLock<Box<dyn Any + Send + Sync>>>>,
    #[cfg(feature = "gpu")]
    pub(crate) topology: crate::gpu::Topology,
}

impl SoftBlend {
    /// The op of a call whose passes share a cache.
    pub(crate) fn keeping(&self) -> Self {
        Self { kept: Some(self.kept.clone().unwrap_or_default()), ..self.clone() }
    }

    /// Number of the inputs: [`run`](Self::run) names them.
    pub(crate) fn inputs_count(&self) -> usize {
        4 + usize::from(self.texture.is_some())
    }

    /// The inputs of the kernel.
    pub(crate) fn inputs<'a, F>(
        &'a self,
        slices: &[&'a [F]],
        dims: &[Vec<usize>],
    ) -> Inputs<'a, F> {
        Inputs {
            vertices: slices[0],
            attributes: slices[1],
            tables: slices[2],
            background: slices[3],
            texture: if self.texture.is_some() { slices[4] } else { &[] },
            texture_size: self.texture,
            faces: &self.faces,
            entries: &self.entries,
            edge: self.edge,
            depth: self.depth,
            floor: self.floor,
            planes: self.planes,
            size: self.size,
            near: NEAR,
            far: FARTHEST_SEEN,
            tolerance: self.tolerance,
            culls: self.culls,
            views: dims[0][0],
            shared: dims[1][0] == 1,
        }
    }

    /// A pass over `vertices` `[views, 3, vertices]`, `attributes` `[1 or views, entries, numbers]`, `tables` `[rows, 4]`, `background`
    /// `[channels + 1]` and, if there is one, a texture `[texels, 4]`, to an image `[views, channels + 1, height, width]`, top row first.
    pub(crate) fn run<F: Kernels + Element>(
        &self,
        pass: &Pass,
        slices: &[&[F]],
        dims: &[Vec<usize>],
    ) -> TensorData {
        let (views, channels) = (dims[0][0], dims[3][0] - 1);
        let count = self.inputs_count();
        let inputs = self.inputs(slices, dims);
        let own = OnceLock::new();
        let kept = self.kept.as_deref().unwrap_or(&own);
        let kept = kept.get_or_init(|| Box::new(F::kept(&inputs, self.kept.is_some())));
        let kept: &Kept<F> = kept.downcast_ref().expect("passes over the same inputs");
        // Flags of the five inputs; the texture is the last.
        let five = |flags: &[bool]| {
            let texture = self.texture.is_some() && flags[4];
            [flags[0], flags[1], flags[2], flags[3], texture]
        };
        let values = match pass {
            Pass::Forward => {
                let shape = [views, channels + 1, self.size.height, self.size.width];
                return TensorData::new(F::blend(&inputs, kept), shape);
            }
            Pass::Vjp { wanted } => F::blend_vjp(&inputs, kept, slices[count], five(wanted)),
            Pass::VjpOfVjp { along, wanted } => {
                let [a, b, c, d, e] = five(wanted);
                let wanted = [a, b, c, d, e, wanted[count]];
                let [upstream, direction] = [slices[count], slices[count + 1]];
                F::blend_vjp_of_vjp(&inputs, kept, upstream, direction, five(along), wanted)
            }
        };
        flat(values)
    }
}
