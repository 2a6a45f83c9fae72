use std::{
    any::Any,
    sync::{Arc, OnceLock},
};

use softrast_kernel::{
    Grid, Kernels,
    blend::{DepthGrid, Inputs, Kept},
};
use softrast_tensor::{Element, TensorData};

use crate::{ImageSize, NEAR, ops::pass::Pass, weighting::FARTHEST_SEEN};

/// What stays the same over the calls of the op: faces, image size, the places of the knots, and what may be left out.
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
    /// What all that is left out of a pixel may add up to, in weights of the background.
    pub(crate) tolerance: f64,
    /// Whether back faces are not drawn.
    pub(crate) culls: bool,
    /// What a pass forward leaves to the passes back, of an op that is recorded: which faces reach which rows, 28 bytes for each face of
    /// each view, and the sums of each pixel: channels and share in fours, and one number more. Its type is that of the floats.
    pub(crate) kept: Option<Arc<OnceLock<Box<dyn Any + Send + Sync>>>>,
    #[cfg(feature = "wgpu")]
    pub(crate) topology: crate::gpu::Topology,
}

impl SoftBlend {
    /// The op of one call whose passes share what they find out.
    pub(crate) fn keeping(&self) -> Self {
        Self { kept: Some(self.kept.clone().unwrap_or_default()), ..self.clone() }
    }

    /// A pass over `vertices` `[views, 3, vertices]`, `attributes` `[1 or views, entries, numbers]`, `tables` `[rows, 4]`,
    /// `background` `[channels + 1]` and, if there is one, a texture `[texels, 4]`, to an image `[views, channels + 1, height, width]`, top
    /// row first.
    pub(crate) fn run<F: Kernels + Element>(
        &self,
        pass: &Pass,
        slices: &[&[F]],
        dims: &[Vec<usize>],
    ) -> TensorData {
        let (views, channels) = (dims[0][0], dims[3][0] - 1);
        let count = 4 + usize::from(self.texture.is_some());
        let inputs = Inputs {
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
            views,
            shared: dims[1][0] == 1,
        };
        let own = OnceLock::new();
        let kept = self.kept.as_deref().unwrap_or(&own);
        let kept = kept.get_or_init(|| Box::new(F::kept(&inputs, self.kept.is_some())));
        let kept: &Kept<F> = kept.downcast_ref().expect("passes over the same inputs");
        // Of each input, the texture being the last of five.
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
        let length = values.len();
        TensorData::new(values, [length])
    }
}
