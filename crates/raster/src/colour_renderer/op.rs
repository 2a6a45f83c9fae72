use softrast_kernel::blend::TEXEL_CHANNELS;
use softrast_tensor::{Backend, FloatTensor, Tensor};

use crate::{
    Attributes, Background, RasterBackend,
    backend::{fused, primitive},
    ops::FusedOp,
    ops::{blend::SoftBlend, blend_loss::BlendLoss},
};

/// Blends the attributes of the faces of each pixel by their weights: the op of every soft colour image, and its inputs.
pub(super) struct Call<B: RasterBackend> {
    op: SoftBlend,
    inputs: Vec<FloatTensor<B>>,
}

impl<B: RasterBackend> Call<B> {
    /// `vertices` is `[views, vertices, 3]`: x and y in NDC and the camera depth; `tables` are those of the curves that `op` was created for.
    ///
    /// # Panics
    ///
    /// If the shapes do not fit or the float types differ.
    pub(super) fn new(
        op: SoftBlend,
        vertices: Tensor<B, 3>,
        attributes: &Attributes<B>,
        tables: Tensor<B, 2>,
        background: &Background<B>,
    ) -> Self {
        let [views, count, three] = vertices.dims();
        assert_eq!(three, 3, "vertices must be [views, vertices, 3], found {:?}", vertices.dims());
        let largest = op.faces.iter().flatten().max().map_or(0, |&v| v as usize + 1);
        assert!(largest <= count, "a face uses vertex {}, but there are {count}", largest - 1);
        let (values, channels) = (attributes.values.clone(), attributes.channels());
        let [own, ..] = values.dims();
        assert!(own == 1 || own == views, "attributes of {own} views, but there are {views}");
        assert_eq!(op.entries.len(), op.faces.len(), "faces that have attributes");
        assert_eq!(background.colour.dims(), [channels], "channels of the background");
        let texture = attributes.texture.clone().map(texels);
        let of_texture = texture.as_ref().map_or(vertices.dtype(), Tensor::dtype);
        let types = [values.dtype(), tables.dtype(), background.colour.dtype(), of_texture];
        assert_eq!(
            types,
            [vertices.dtype(); 4],
            "attributes, tables, background and texture differ in float type"
        );
        let behind = Tensor::cat(vec![background.colour.clone(), background.log_weight.clone()], 0);
        let mut inputs = vec![
            primitive(vertices.swap_dims(1, 2)),
            primitive(values),
            primitive(tables),
            primitive(behind),
        ];
        inputs.extend(texture.map(primitive));
        Self { op, inputs }
    }

    /// The image `[views, channels + 1, height, width]`; the last channel is the faces' share.
    pub(super) fn image(self) -> Tensor<B, 4> {
        fused(&FusedOp::SoftBlend(self.op), self.inputs)
    }

    /// The squared error `[views]` of the first planes of the image relative to a target `[1 or views, planes, height, width]` in one op, if
    /// there is one: for gradients of first order to vertices, attributes, background and texture.
    pub(super) fn squared_error(&self, target: Tensor<B, 4>) -> Option<Tensor<B, 1>> {
        let target = primitive(target);
        let tracked: Vec<bool> = self.inputs.iter().map(B::is_tracked).collect();
        let wanted: [bool; 5] =
            std::array::from_fn(|k| tracked.get(k).is_some_and(|&tracked| tracked));
        if !B::ON_HOST || B::ORDERS != 1 || B::is_tracked(&target) {
            return None;
        }
        wanted.contains(&true).then(|| {
            let op = BlendLoss { blend: self.op.clone(), wanted, kept: None };
            let inputs = self.inputs.iter().cloned().chain([target]).collect();
            fused(&FusedOp::BlendLoss(op), inputs)
        })
    }
}

/// A texture as an input of the op: `[texels, 4]`.
fn texels<B: Backend>(texture: Tensor<B, 3>) -> Tensor<B, 2> {
    let [height, width, channels] = texture.dims();
    let rows = texture.reshape([height * width, channels]);
    if channels == TEXEL_CHANNELS {
        return rows;
    }
    let options = (&rows.device(), rows.dtype());
    let rest = Tensor::zeros([height * width, TEXEL_CHANNELS - channels], options);
    Tensor::cat(vec![rows, rest], 1)
}
