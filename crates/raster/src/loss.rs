use softrast_kernel::PixelLoss;
use softrast_tensor::{Backend, Tensor};

use crate::{
    RasterBackend,
    backend::{elementary, primitive},
    ops::ElementaryOp,
};

/// Soft intersection over union loss `1 - |p ∩ t| / |p ∪ t|` of each view: `1 - Σ p t / (Σ (p + t - p t) + 1e-6)`.
///
/// `image` and `target` are `[views, height, width]` in [0, 1]; the result is `[views]`. The loss of an empty image or target is 1, also if
/// both are empty: such a target cannot be matched. Either of them may be `[1, height, width]`, for all views.
///
/// # Panics
///
/// If the images differ in size.
///
/// Source: docs/notes.md, Losses and errors.
pub fn iou_loss<B: RasterBackend>(image: Tensor<B, 3>, target: Tensor<B, 3>) -> Tensor<B, 1> {
    compared(PixelLoss::Iou, image, target)
}

/// Mean squared difference of each view: `[views, height, width]`, or with channels `[views, channels, height, width]`, to `[views]`.
/// Either of the two images may have a single view, used for all.
///
/// # Panics
///
/// If the images differ in size.
pub fn mse_loss<B: RasterBackend, const D: usize>(
    image: Tensor<B, D>,
    target: Tensor<B, D>,
) -> Tensor<B, 1> {
    compared(PixelLoss::SquaredError, image, target)
}

/// The loss of each view, with an optional weight for each pixel of the image.
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

/// The loss of each view, in one op; an image with a single view is compared with all views of the other.
fn compared<B: RasterBackend, const D: usize>(
    loss: PixelLoss,
    image: Tensor<B, D>,
    target: Tensor<B, D>,
) -> Tensor<B, 1> {
    let [a, b] = [image.dims()[0], target.dims()[0]];
    let fits = image.dims()[1..] == target.dims()[1..] && (a == b || a == 1 || b == 1);
    assert!(fits, "images {:?} and {:?} cannot be compared", image.dims(), target.dims());
    elementary(ElementaryOp::Loss(loss), vec![primitive(image), primitive(target)])
}

/// Added to squared lengths before a division or a square root, in squared world units.
///
/// Hides edges and heights below a thousandth of a unit, and so keeps both derivatives finite where faces collapse. Source: docs/notes.md,
/// Losses and errors.
const EPSILON: f64 = 1e-6;

/// Flatness loss: `Σ (cos α + 1)²` over all edges between two faces, `[1]`.
///
/// `α` is the angle between the heights of both faces on their common edge: 180° where the surface is flat, so that the term is 0. `hinges`
/// `[shapes, 3, 4 edges]` holds the corners of both faces of each edge: its two ends, then the two opposite corners; all first corners
/// before all second ones, and so on. Source: docs/notes.md, Losses and errors.
///
/// # Panics
///
/// If there is no edge, or the last axis is not a multiple of four.
pub fn flatness<B: Backend>(hinges: Tensor<B, 3>) -> Tensor<B, 1> {
    let bend = bend(hinges);
    (bend.clone() * bend).sum()
}

/// Normal consistency: the mean of `1 - cos β` over all edges between two faces, `[1]`; β is the angle between their normals, 180° minus
/// the `α` of [`flatness`]. `hinges` has the same layout.
///
/// # Panics
///
/// If there is no edge, or the last axis is not a multiple of four.
pub fn normal_consistency<B: Backend>(hinges: Tensor<B, 3>) -> Tensor<B, 1> {
    bend(hinges).mean()
}

/// Mean of `(|e| - length)²` over edges, `[1]`, in squared world units. `ends` `[shapes, 3, 2 edges]` holds both ends of each edge, all
/// first ends before all second ones. The length of an edge is `√(|e|² + 1e-6)`, so that derivatives stay finite.
///
/// # Panics
///
/// If there is no edge, or the last axis is not a multiple of two.
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

/// Dot products along the middle axis: `[shapes, 3, n]` twice to `[shapes, 1, n]`.
fn dot<B: Backend>(a: &Tensor<B, 3>, b: &Tensor<B, 3>) -> Tensor<B, 3> {
    (a.clone() * b.clone()).sum_dim(1)
}
