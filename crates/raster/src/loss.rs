use burn::tensor::{Tensor, backend::Backend};

use crate::{
    RasterBackend,
    backend::{elementary, primitive},
    fused::ElementaryOp,
    reference,
};

/// Keeps the ratio of two empty images defined.
pub(crate) const EMPTY: f64 = 1e-6;

/// `1 - |p ∩ t| / |p ∪ t|` of each view, soft: `1 - Σ p t / (Σ (p + t - p t) + 1e-6)`.
///
/// `image` and `target` are `[views, height, width]` in [0, 1]; the result is `[views]`. Two empty
/// images give 1, as an empty one against any other does: such a target cannot be matched.
///
/// Source: docs/notes.md, Losses and errors.
pub fn iou_loss<B: RasterBackend>(image: Tensor<B, 3>, target: Tensor<B, 3>) -> Tensor<B, 1> {
    match B::ON_HOST {
        true => compared(ElementaryOp::Iou, image, target),
        false => reference::iou_loss(image, target),
    }
}

/// Mean squared difference of each view: `[views, height, width]` to `[views]`.
pub fn mse_loss<B: RasterBackend>(image: Tensor<B, 3>, target: Tensor<B, 3>) -> Tensor<B, 1> {
    match B::ON_HOST {
        true => compared(ElementaryOp::SquaredError, image, target),
        false => reference::mse_loss(image, target),
    }
}

/// The loss of each view, in one op; one image may be compared with those of all views.
fn compared<B: RasterBackend>(
    loss: ElementaryOp,
    image: Tensor<B, 3>,
    target: Tensor<B, 3>,
) -> Tensor<B, 1> {
    let ([a, height, width], [b, ..]) = (image.dims(), target.dims());
    let shape = [a.max(b), height, width];
    let of_all =
        |images: Tensor<B, 3>| if images.dims() == shape { images } else { images.expand(shape) };
    elementary(loss, vec![primitive(of_all(image)), primitive(of_all(target))])
}

/// Added to squared lengths before they divide or a root is taken, in squared world units.
///
/// Hides edges and heights below a thousandth of a unit, and so keeps both derivatives finite where
/// faces collapse. Source: docs/notes.md, Losses and errors.
const EPSILON: f64 = 1e-6;

/// How sharply surfaces bend: `Σ (cos α + 1)²` over all edges between two faces, `[1]`.
///
/// `α` is the angle between the heights of both faces on their common edge: half a turn where the
/// surface is flat, so that it adds nothing. `hinges` `[shapes, 3, 4 edges]` holds the corners of both
/// faces of each edge: its two ends, then the two others; all first ones before all second ones, and
/// so on. Source: docs/notes.md, Losses and errors.
///
/// # Panics
///
/// If there is no edge, or the last axis is not four parts.
pub fn flatness<B: Backend>(hinges: Tensor<B, 3>) -> Tensor<B, 1> {
    let [from, to, one, other] = hinges.chunk(4, 2).try_into().expect("four equal parts");
    let edge = to - from.clone();
    let inverse = (dot(&edge, &edge) + EPSILON).recip();
    let heights = [one, other].map(|corner| {
        let side = corner - from.clone();
        side.clone() - edge.clone() * (dot(&side, &edge) * inverse.clone())
    });
    let [h1, h2] = &heights;
    let lengths = (dot(h1, h1) + EPSILON) * (dot(h2, h2) + EPSILON);
    let bend = dot(h1, h2) * lengths.sqrt().recip() + 1.0;
    (bend.clone() * bend).sum()
}

/// Of the vectors along the middle axis: `[shapes, 3, n]` twice to `[shapes, 1, n]`.
fn dot<B: Backend>(a: &Tensor<B, 3>, b: &Tensor<B, 3>) -> Tensor<B, 3> {
    (a.clone() * b.clone()).sum_dim(1)
}
