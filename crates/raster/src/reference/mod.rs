//! The definition: burn tensor ops over every pixel-face pair, on any backend, to any order.
//!
//! Slow (about 1.3 kB of traffic a pair) and simple; every faster path is tested against it.

mod blend;

use softrast_softness::Softness;
use softrast_tensor::{Autodiff, Backend, Int, Tensor, TensorData};

pub use crate::tensor_ops::{iou_loss, mse_loss, orbit_matrices, perspective};
use crate::{ImageSize, NEAR, TConorm};
pub use blend::blended;

/// Squared edge lengths below this (NDC²) count as a point.
const POINT: f64 = 1e-30;
/// Squared distances below this (NDC²) count as 0, with gradient 0 instead of the infinite one of the
/// square root.
const ON_EDGE: f64 = 1e-24;
/// Pixel-face pairs that one chunk of [`sums`] and [`vjp`] may hold.
const PAIRS: usize = 1 << 18;

/// What to draw: faces over the vertices of every view, on an image.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// Corners of each face, as vertex numbers.
    pub faces: &'a [[u32; 3]],
    /// Height and width of the image in pixels.
    pub size: ImageSize,
}

/// Signed distances from pixels to faces in NDC, positive inside: `[views, pixels, faces]`.
///
/// `vertices` is `[views, vertices, 3]` (x and y in NDC, depth), `pixels` `[pixels, 2]` in NDC.
/// Inside or outside is told by edge functions, the distance is that to the nearest point of the
/// boundary. Edges belong to the inside; a face without area has none.
///
/// Source: Petersen et al. 2022, computed by projection onto the edges instead of barycentric
/// coordinates (docs/notes.md, Signed distance).
///
/// # Panics
///
/// If a face uses a vertex that is not there.
pub fn signed_distance<B: Backend>(
    vertices: Tensor<B, 3>,
    faces: &[[u32; 3]],
    pixels: Tensor<B, 2>,
) -> Tensor<B, 3> {
    let [a, b, c] = corners(vertices, faces);
    let count = pixels.dims()[0];
    let p = [0, 1].map(|axis| pixels.clone().narrow(1, axis, 1).reshape([1, count, 1]));
    let area = cross(between(&a, &b), between(&b, &c));
    let orientation = area.sign().detach();
    let [ab, bc, ca] = [(&a, &b), (&b, &c), (&c, &a)].map(|(from, to)| edge(&p, from, to));
    let nearest = lesser(lesser(ab.distance2, bc.distance2), ca.distance2);
    let within = |side: Tensor<B, 3>| (side * orientation.clone()).greater_equal_elem(0.0);
    let inside = within(ab.side).bool_and(within(bc.side)).bool_and(within(ca.side));
    let flat = orientation.clone().equal_elem(0.0).expand(nearest.dims());
    let inside = inside.bool_and(flat.bool_not());
    signed(nearest, inside)
}

/// Signed distances of squared ones.
fn signed<B: Backend>(
    distance2: Tensor<B, 3>,
    inside: Tensor<B, 3, softrast_tensor::Bool>,
) -> Tensor<B, 3> {
    // Selected by the argument, so that neither the root nor its gradient meets 0.
    let on_edge = distance2.clone().lower_elem(ON_EDGE);
    let distance = distance2.mask_fill(on_edge.clone(), 1.0).sqrt().mask_fill(on_edge, 0.0);
    distance.clone().neg().mask_where(inside, distance)
}

/// x and y of places, or of the ways between them.
type Plane<B> = [Tensor<B, 3>; 2];

/// An edge as points see it.
struct Edge<B: Backend> {
    /// Squared distance to its closest point.
    distance2: Tensor<B, 3>,
    /// Positive on its left: the doubled area of the triangle that it makes with the point.
    side: Tensor<B, 3>,
    /// The place of the closest point on it, 0 to 1.
    along: Tensor<B, 3>,
}

fn edge<B: Backend>(p: &Plane<B>, start: &[Tensor<B, 3>; 3], end: &[Tensor<B, 3>; 3]) -> Edge<B> {
    let [ex, ey] = between(start, end);
    let [wx, wy] = [0, 1].map(|k| p[k].clone() - start[k].clone());
    let length2 = ex.clone() * ex.clone() + ey.clone() * ey.clone();
    let point = length2.clone().lower_elem(POINT);
    let inverse = length2.mask_fill(point.clone(), 1.0).recip().mask_fill(point, 0.0);
    let along = ((wx.clone() * ex.clone() + wy.clone() * ey.clone()) * inverse).clamp(0.0, 1.0);
    let dx = wx.clone() - along.clone() * ex.clone();
    let dy = wy.clone() - along.clone() * ey.clone();
    let distance2 = dx.clone() * dx + dy.clone() * dy;
    Edge { distance2, side: cross([ex, ey], [wx, wy]), along }
}

/// From one corner to another.
fn between<B: Backend>(start: &[Tensor<B, 3>; 3], end: &[Tensor<B, 3>; 3]) -> Plane<B> {
    [0, 1].map(|k| end[k].clone() - start[k].clone())
}

fn cross<B: Backend>([ux, uy]: Plane<B>, [vx, vy]: Plane<B>) -> Tensor<B, 3> {
    ux * vy - uy * vx
}

/// The lesser of two numbers; where they are the same, the first with all of the gradient.
fn lesser<B: Backend>(a: Tensor<B, 3>, b: Tensor<B, 3>) -> Tensor<B, 3> {
    let less = b.clone().lower(a.clone());
    a.mask_where(less, b)
}

/// Sums of `g(s(d))` over the faces of each pixel: `[views, height, width]`, top row first.
///
/// Computed in chunks of pixels of one view, so that memory stays bounded; under autodiff the tape
/// still holds all chunks, see [`vjp`] for a gradient that does not. Faces with a vertex nearer than
/// [`NEAR`] are left out.
pub fn sums<B: Backend>(
    scene: Scene,
    vertices: Tensor<B, 3>,
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: Tensor<B, 1>,
) -> Tensor<B, 3> {
    let views = vertices.dims()[0];
    let chunks = chunks(scene, views);
    let parts = chunks
        .into_iter()
        .map(|(view, pixels)| {
            let vertices = vertices.clone().narrow(0, view, 1);
            chunk_sums(scene, vertices, softness, t_conorm, phi.clone(), &pixels)
        })
        .collect();
    Tensor::cat(parts, 0).reshape([views, scene.size.height, scene.size.width])
}

/// Gradient of `Σ upstream · sums` to the vertices `[views, vertices, 3]`, chunk by chunk: memory
/// is that of one chunk. `upstream` is `[views, height, width]`.
///
/// # Panics
///
/// If `upstream` does not fit the image, or a face uses a vertex that is not there.
pub fn vjp<B: Backend>(
    scene: Scene,
    vertices: Tensor<B, 3>,
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: Tensor<B, 1>,
    upstream: Tensor<B, 3>,
) -> Tensor<B, 3> {
    let [views, count, _] = vertices.dims();
    let phi = Tensor::<Autodiff<B>, 1>::from_inner(phi);
    let upstream = upstream.reshape([views * scene.size.pixels()]);
    let mut start = 0;
    let mut totals: Vec<Option<Tensor<B, 3>>> = vec![None; views];
    for (view, pixels) in chunks(scene, views) {
        let leaf = Tensor::<Autodiff<B>, 3>::from_inner(vertices.clone().narrow(0, view, 1))
            .require_grad();
        let sums = chunk_sums(scene, leaf.clone(), softness, t_conorm, phi.clone(), &pixels);
        let upstream = Tensor::from_inner(upstream.clone().narrow(0, start, pixels.len()));
        start += pixels.len();
        let grads = (sums * upstream).sum().backward();
        if let Some(grad) = leaf.grad(&grads) {
            let total = &mut totals[view];
            *total = Some(total.take().map_or(grad.clone(), |total| total + grad));
        }
    }
    let empty = || vertices.clone().narrow(0, 0, 1) * 0.0;
    let parts = totals.into_iter().map(|total| total.unwrap_or_else(empty)).collect();
    Tensor::cat(parts, 0).reshape([views, count, 3])
}

/// Sums of one chunk: `vertices` `[1, vertices, 3]`, pixels of that view; `[pixels]`.
fn chunk_sums<B: Backend>(
    scene: Scene,
    vertices: Tensor<B, 3>,
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: Tensor<B, 1>,
    pixels: &std::ops::Range<usize>,
) -> Tensor<B, 1> {
    let places = places(&vertices, scene, pixels);
    let distance = signed_distance(vertices.clone(), scene.faces, places);
    let (value, _) = t_conorm.profile(softness, phi, distance);
    let hidden = hidden(vertices, scene.faces).expand(value.dims());
    value.mask_fill(hidden, 0.0).sum_dim(2).reshape([pixels.len()])
}

/// Faces that are not drawn: `[views, 1, faces]`.
fn hidden<B: Backend>(
    vertices: Tensor<B, 3>,
    faces: &[[u32; 3]],
) -> Tensor<B, 3, softrast_tensor::Bool> {
    let [a, b, c] = corners(vertices, faces).map(|[_, _, depth]| depth.lower_elem(NEAR));
    a.bool_or(b).bool_or(c)
}

/// Coordinates of the corners, each `[views, 1, faces]`: first the corner, then x, y, depth.
fn corners<B: Backend>(vertices: Tensor<B, 3>, faces: &[[u32; 3]]) -> [[Tensor<B, 3>; 3]; 3] {
    let [views, _, _] = vertices.dims();
    let device = vertices.device();
    [0, 1, 2].map(|k| {
        let index: Vec<i64> = faces.iter().map(|face| i64::from(face[k])).collect();
        let index = Tensor::<B, 1, Int>::from_data(TensorData::new(index, [faces.len()]), &device);
        let corner = vertices.clone().select(1, index);
        [0, 1, 2].map(|axis| corner.clone().narrow(2, axis, 1).reshape([views, 1, faces.len()]))
    })
}

/// Centres of the given pixels, `[pixels, 2]` in NDC.
fn places<B: Backend>(
    like: &Tensor<B, 3>,
    scene: Scene,
    pixels: &std::ops::Range<usize>,
) -> Tensor<B, 2> {
    let ImageSize { height, width } = scene.size;
    let half = height.min(width) as f64 / 2.0;
    let place = |pixel: usize| {
        let (row, column) = (pixel / width, pixel % width);
        [
            (column as f64 + 0.5 - width as f64 / 2.0) / half,
            (height as f64 / 2.0 - row as f64 - 0.5) / half,
        ]
    };
    let places: Vec<f64> = pixels.clone().flat_map(place).collect();
    let data = TensorData::new(places, [pixels.len(), 2]);
    Tensor::from_data(data, (&like.device(), like.dtype()))
}

/// Views and pixel ranges of at most [`PAIRS`] pairs.
fn chunks(scene: Scene, views: usize) -> Vec<(usize, std::ops::Range<usize>)> {
    let pixels = scene.size.pixels();
    let step = (PAIRS / scene.faces.len().max(1)).clamp(1, pixels);
    let ranges = move || (0..pixels).step_by(step).map(move |at| at..(at + step).min(pixels));
    (0..views).flat_map(|view| ranges().map(move |range| (view, range))).collect()
}
