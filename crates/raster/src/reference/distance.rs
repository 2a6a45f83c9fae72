//! The signed distance from a pixel to a face.

use softrast_tensor::{Backend, Bool, Int, Tensor, TensorData};

/// Squared edge lengths below this (NDC²) count as a point.
const POINT: f64 = 1e-30;
/// Squared distances below this (NDC²) count as 0, with gradient 0 instead of the infinite one of the
/// square root.
const ON_EDGE: f64 = 1e-24;
/// Signed distances from pixels to faces in NDC, positive inside: `[views, pixels, faces]`.
///
/// `vertices` is `[views, vertices, 3]` (x and y in NDC, depth), `pixels` `[pixels, 2]` in NDC. Edge functions determine inside and
/// outside; the distance is that to the nearest point of the boundary. Edges belong to the inside; a face without area has none.
///
/// ```
/// use softrast_raster::{HostBackend, reference::signed_distance, vertex_tensor};
/// use softrast_tensor::{numbers, tensor};
///
/// let corners = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let corners = vertex_tensor::<HostBackend>(&corners, &Default::default());
/// let pixels = tensor(vec![0.25, 0.25, 0.5, -0.5], [2, 2]);
/// assert_eq!(numbers(signed_distance(corners, &[[0, 1, 2]], pixels)), [0.25, -0.5]);
/// ```
///
/// Source: Petersen et al. 2022, computed by projection onto the edges instead of barycentric
/// coordinates (docs/notes.md, Signed distance).
///
/// # Panics
///
/// If a vertex number of a face is out of range.
pub fn signed_distance<B: Backend>(
    vertices: Tensor<B, 3>,
    faces: &[[u32; 3]],
    pixels: Tensor<B, 2>,
) -> Tensor<B, 3> {
    let Boundary { distance2, inside, .. } = Boundary::new(&corners(vertices, faces), pixels);
    signed(distance2, inside)
}

/// Signed distances from squared distances.
pub(super) fn signed<B: Backend>(
    distance2: Tensor<B, 3>,
    inside: Tensor<B, 3, Bool>,
) -> Tensor<B, 3> {
    // Masked before the square root, so that neither the root nor its gradient is evaluated at 0.
    let on_edge = distance2.clone().lower_elem(ON_EDGE);
    let distance = distance2.mask_fill(on_edge.clone(), 1.0).sqrt().mask_fill(on_edge, 0.0);
    distance.clone().neg().mask_where(inside, distance)
}

/// x and y of positions, or of offsets between them.
type Plane<B> = [Tensor<B, 3>; 2];

/// The closest points of the boundaries of faces to pixels, each `[views, pixels, faces]`.
pub(super) struct Boundary<B: Backend> {
    /// Squared distance to the closest point.
    pub(super) distance2: Tensor<B, 3>,
    /// Whether the pixel lies in the face, edges included.
    pub(super) inside: Tensor<B, 3, Bool>,
    /// Whether the closest point is on the second edge rather than the first, and on the third rather than these.
    second: Tensor<B, 3, Bool>,
    third: Tensor<B, 3, Bool>,
    /// Position of the closest point on its edge, 0 to 1.
    along: Tensor<B, 3>,
    /// Doubled areas of the triangles that the edges make with the pixel, positive on the inner side.
    pub(super) sides: [Tensor<B, 3>; 3],
}

impl<B: Backend> Boundary<B> {
    /// Closest points of faces with these corners to `pixels` `[pixels, 2]` in NDC.
    pub(super) fn new([a, b, c]: &[[Tensor<B, 3>; 3]; 3], pixels: Tensor<B, 2>) -> Self {
        let count = pixels.dims()[0];
        let p = [0, 1].map(|axis| pixels.clone().narrow(1, axis, 1).reshape([1, count, 1]));
        let orientation = cross(between(a, b), between(b, c)).sign().detach();
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(from, to)| edge(&p, from, to));
        let second = bc.distance2.clone().lower(ab.distance2.clone());
        let nearer = lesser(ab.distance2, bc.distance2);
        let third = ca.distance2.clone().lower(nearer.clone());
        let distance2 = lesser(nearer, ca.distance2);
        let sides = [ab.side, bc.side, ca.side].map(|side| side * orientation.clone());
        let within = |side: &Tensor<B, 3>| side.clone().greater_equal_elem(0.0);
        let inside = sides.iter().map(within).reduce(Tensor::bool_and).expect("three sides");
        let flat = orientation.equal_elem(0.0).expand(distance2.dims());
        let inside = inside.bool_and(flat.bool_not());
        let along = pick([&second, &third], [ab.along, bc.along, ca.along]);
        Self { distance2, inside, second, third, along, sides }
    }

    /// Barycentric weights of the closest points.
    pub(super) fn weights(&self) -> [Tensor<B, 3>; 3] {
        let on = [&self.second, &self.third];
        let along = || self.along.clone();
        let rest = || along().neg() + 1.0;
        let zero = || along() * 0.0;
        [
            pick(on, [rest(), zero(), along()]),
            pick(on, [along(), rest(), zero()]),
            pick(on, [zero(), along(), rest()]),
        ]
    }
}

/// The number of the edge on which a point lies.
fn pick<B: Backend>(
    [second, third]: [&Tensor<B, 3, Bool>; 2],
    [a, b, c]: [Tensor<B, 3>; 3],
) -> Tensor<B, 3> {
    a.mask_where(second.clone(), b).mask_where(third.clone(), c)
}

/// An edge relative to points.
struct Edge<B: Backend> {
    /// Squared distance to the closest point of the edge.
    distance2: Tensor<B, 3>,
    /// Doubled area of the triangle of edge and point, positive to the left of the edge.
    side: Tensor<B, 3>,
    /// Position of the closest point on the edge, 0 to 1.
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

/// The vector from one corner to another.
fn between<B: Backend>(start: &[Tensor<B, 3>; 3], end: &[Tensor<B, 3>; 3]) -> Plane<B> {
    [0, 1].map(|k| end[k].clone() - start[k].clone())
}

fn cross<B: Backend>([ux, uy]: Plane<B>, [vx, vy]: Plane<B>) -> Tensor<B, 3> {
    ux * vy - uy * vx
}

/// The lesser of two numbers; if they are equal, the first, which gets the whole gradient.
fn lesser<B: Backend>(a: Tensor<B, 3>, b: Tensor<B, 3>) -> Tensor<B, 3> {
    let less = b.clone().lower(a.clone());
    a.mask_where(less, b)
}

/// Coordinates of the corners, each `[views, 1, faces]`: first the corner, then x, y, depth.
pub(super) fn corners<B: Backend>(
    vertices: Tensor<B, 3>,
    faces: &[[u32; 3]],
) -> [[Tensor<B, 3>; 3]; 3] {
    let [views, _, _] = vertices.dims();
    let device = vertices.device();
    [0, 1, 2].map(|k| {
        let index: Vec<i64> = faces.iter().map(|face| i64::from(face[k])).collect();
        let index = Tensor::<B, 1, Int>::from_data(TensorData::new(index, [faces.len()]), &device);
        let corner = vertices.clone().select(1, index);
        [0, 1, 2].map(|axis| corner.clone().narrow(2, axis, 1).reshape([views, 1, faces.len()]))
    })
}
