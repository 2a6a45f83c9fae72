use softrast_kernel::blend::TEXEL_CHANNELS;
use softrast_tensor::{Backend, Tensor};

use crate::{
    Attributes, Background, RasterBackend,
    backend::{fused, primitive},
    ops::FusedOp,
    ops::blend::SoftBlend,
};

/// Blends the attributes of the faces of each pixel by their weights: the op of every soft colour image.
///
/// `vertices` is `[views, vertices, 3]`: x and y in NDC and the camera depth; `tables` are those of the curves that `op` was created for.
/// The result is `[views, channels + 1, height, width]`; the last channel is the faces' share.
///
/// # Panics
///
/// If the shapes do not fit or the float types differ.
pub(super) fn soft_blend<B: RasterBackend>(
    op: SoftBlend,
    vertices: Tensor<B, 3>,
    attributes: &Attributes<B>,
    tables: Tensor<B, 2>,
    background: &Background<B>,
) -> Tensor<B, 4> {
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
    fused(&FusedOp::SoftBlend(op), inputs)
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
