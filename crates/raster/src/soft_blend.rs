use std::sync::Arc;

use burn::tensor::{Element, Tensor, TensorData, backend::Backend};

use crate::{
    Background, ImageSize, NEAR, RasterBackend,
    backend::{fused, primitive},
    fused::{FusedOp, Pass},
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

/// Blends the attributes of the faces of each pixel by their weights: the one op under every soft image in colour.
///
/// `vertices` is `[views, vertices, 3]`: x and y in NDC and the camera depth; `tables` are those of the curves that `op` was made for. The
/// result is `[views, channels + 1, height, width]`, the last channel being the faces' share.
///
/// # Panics
///
/// If the shapes do not fit or the float types differ.
pub(crate) fn soft_blend<B: RasterBackend>(
    op: SoftBlend,
    vertices: Tensor<B, 3>,
    attributes: Tensor<B, 3>,
    tables: Tensor<B, 2>,
    background: &Background<B>,
) -> Tensor<B, 4> {
    let [views, count, three] = vertices.dims();
    assert_eq!(three, 3, "vertices must be [views, vertices, 3], found {:?}", vertices.dims());
    let largest = op.faces.iter().flatten().max().map_or(0, |&v| v as usize + 1);
    assert!(largest <= count, "a face uses vertex {}, but there are {count}", largest - 1);
    let [own, _, channels] = attributes.dims();
    assert!(own == 1 || own == views, "attributes of {own} views, but there are {views}");
    assert_eq!(op.entries.len(), op.faces.len(), "faces that have attributes");
    assert_eq!(background.colour.dims(), [channels], "channels of the background");
    let types = [attributes.dtype(), tables.dtype(), background.colour.dtype()];
    assert_eq!(
        types,
        [vertices.dtype(); 3],
        "attributes, tables and background differ in float type"
    );
    let behind = Tensor::cat(vec![background.colour.clone(), background.log_weight.clone()], 0);
    let inputs = vec![
        primitive(vertices.swap_dims(1, 2)),
        primitive(attributes),
        primitive(tables),
        primitive(behind),
    ];
    fused(&FusedOp::SoftBlend(op), inputs)
}

/// Both tables as the op takes them, `[rows, 4]`.
pub(crate) fn tables<B: Backend>(edge: Tensor<B, 2>, depth: Tensor<B, 2>) -> Tensor<B, 2> {
    Tensor::cat(vec![edge, depth], 0)
}
