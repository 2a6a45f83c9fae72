use softrast_kernel::PixelLoss;
use softrast_tensor::{Backend, Tensor};

use crate::{
    RasterBackend,
    backend::{elementary, primitive},
    ops::ElementaryOp,
};

/// `1 - |p ∩ t| / |p ∪ t|` of each view, soft: `1 - Σ p t / (Σ (p + t - p t) + 1e-6)`.
///
/// `image` and `target` are `[views, height, width]` in [0, 1]; the result is `[views]`. Two empty
/// images give 1, as an empty one against any other does: such a target cannot be matched. One of the two may be `[1, height, width]`,
/// for all views.
///
/// # Panics
///
/// If the images differ in size.
///
/// Source: docs/notes.md, Losses and errors.
pub fn iou_loss<B: RasterBackend>(image: Tensor<B, 3>, target: Tensor<B, 3>) -> Tensor<B, 1> {
    compared(ElementaryOp::Iou, image, target)
}

/// Mean squared difference of each view: `[views, height, width]`, or with channels `[views, channels, height, width]`, to `[views]`. One of
/// the two images may be that of one view, for all.
///
/// # Panics
///
/// If the images differ in size.
pub fn mse_loss<B: RasterBackend, const D: usize>(
    image: Tensor<B, D>,
    target: Tensor<B, D>,
) -> Tensor<B, 1> {
    compared(ElementaryOp::SquaredError, image, target)
}

/// The loss of each view, where a share of each pixel of the image counts, or all of it.
pub(crate) fn loss_of_images<B: RasterBackend>(
    loss: PixelLoss,
    image: Tensor<B, 3>,
    target: Tensor<B, 3>,
    counted: Option<Tensor<B, 3>>,
) -> Tensor<B, 1> {
    let image = match counted {
        Some(counted) => image * counted,
        None => image,
    };
    match loss {
        PixelLoss::SquaredError => mse_loss(image, target),
        PixelLoss::Iou => iou_loss(image, target),
    }
}

/// The loss of each view, in one op; one image may be compared with those of all views.
fn compared<B: RasterBackend, const D: usize>(
    loss: ElementaryOp,
    image: Tensor<B, D>,
    target: Tensor<B, D>,
) -> Tensor<B, 1> {
    let [a, b] = [image.dims()[0], target.dims()[0]];
    let fits = image.dims()[1..] == target.dims()[1..] && (a == b || a == 1 || b == 1);
    assert!(fits, "images {:?} and {:?} cannot be compared", image.dims(), target.dims());
    elementary(loss, vec![primitive(image), primitive(target)])
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
    let bend = bend(hinges);
    (bend.clone() * bend).sum()
}

/// How far normals of neighbours differ: the mean of `1 - cos β` over all edges between two faces, `[1]`; β is the angle between their
/// normals, half a turn less the `α` of [`flatness`]. `hinges` are as there.
///
/// # Panics
///
/// If there is no edge, or the last axis is not four parts.
pub fn normal_consistency<B: Backend>(hinges: Tensor<B, 3>) -> Tensor<B, 1> {
    bend(hinges).mean()
}

/// Mean of `(|e| - length)²` over edges, `[1]`, in squared world units. `ends` `[shapes, 3, 2 edges]` holds both ends of each edge, all
/// first ones before all second ones. The lengths are those of edges no shorter than a thousandth of a unit, so that derivatives stay
/// finite.
///
/// # Panics
///
/// If there is no edge, or the last axis is not two parts.
pub fn edge_length<B: Backend>(ends: Tensor<B, 3>, length: f64) -> Tensor<B, 1> {
    let [from, to] = ends.chunk(2, 2).try_into().expect("two equal parts");
    let edge = to - from;
    let away = (dot(&edge, &edge) + EPSILON).sqrt() - length;
    (away.clone() * away).mean()
}

/// `cos α + 1` of each hinge; see [`flatness`].
fn bend<B: Backend>(hinges: Tensor<B, 3>) -> Tensor<B, 3> {
    let [from, to, one, other] = hinges.chunk(4, 2).try_into().expect("four equal parts");
    let edge = to - from.clone();
    let inverse = (dot(&edge, &edge) + EPSILON).recip();
    let heights = [one, other].map(|corner| {
        let side = corner - from.clone();
        side.clone() - edge.clone() * (dot(&side, &edge) * inverse.clone())
    });
    let [h1, h2] = &heights;
    let lengths = (dot(h1, h1) + EPSILON) * (dot(h2, h2) + EPSILON);
    dot(h1, h2) * lengths.sqrt().recip() + 1.0
}

/// Of the vectors along the middle axis: `[shapes, 3, n]` twice to `[shapes, 1, n]`.
fn dot<B: Backend>(a: &Tensor<B, 3>, b: &Tensor<B, 3>) -> Tensor<B, 3> {
    (a.clone() * b.clone()).sum_dim(1)
}
