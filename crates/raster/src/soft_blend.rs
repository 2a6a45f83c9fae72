use std::sync::Arc;

use burn::tensor::{Element, TensorData};

use crate::{
    ImageSize, NEAR,
    fused::pass::Pass,
    kernel::{
        Float, Grid,
        blend::{self, DepthGrid, Inputs},
    },
    weighting::FARTHEST_SEEN,
};

/// What stays the same over the calls of the op: faces, image size, the places of the knots, and what may be left out.
#[derive(Clone, Debug)]
pub struct SoftBlend {
    pub(crate) faces: Arc<[[u32; 3]]>,
    pub(crate) entries: Arc<[[u32; 3]]>,
    pub(crate) edge: Grid,
    pub(crate) depth: DepthGrid,
    pub(crate) floor: f64,
    pub(crate) planes: [f64; 2],
    pub(crate) size: ImageSize,
    /// What all that is left out of a pixel may add up to, in weights of the background.
    pub(crate) tolerance: f64,
}

impl SoftBlend {
    /// A pass over `vertices` `[views, 3, vertices]`, `attributes` `[1 or views, entries, channels]`, `tables` `[rows, 4]` and
    /// `background` `[channels + 1]`, to an image `[views, channels + 1, height, width]`, top row first.
    pub(crate) fn run<F: Float + Element>(
        &self,
        pass: &Pass,
        slices: &[&[F]],
        dims: &[Vec<usize>],
    ) -> TensorData {
        let (views, channels) = (dims[0][0], dims[1][2]);
        let inputs = Inputs {
            vertices: slices[0],
            attributes: slices[1],
            tables: slices[2],
            background: slices[3],
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
            views,
            shared: dims[1][0] == 1,
        };
        let four = |flags: &[bool]| [flags[0], flags[1], flags[2], flags[3]];
        let values = match pass {
            Pass::Forward => {
                let shape = [views, channels + 1, self.size.height, self.size.width];
                return TensorData::new(blend::forward(&inputs), shape);
            }
            Pass::Vjp { wanted } => blend::vjp(&inputs, slices[4], four(wanted)),
            Pass::VjpOfVjp { along, wanted } => {
                let [a, b, c, d] = four(wanted);
                let wanted = [a, b, c, d, wanted[4]];
                blend::vjp_of_vjp(&inputs, slices[4], slices[5], four(along), wanted)
            }
        };
        let length = values.len();
        TensorData::new(values, [length])
    }
}
