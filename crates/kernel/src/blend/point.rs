//! The point of a face nearest to a pixel, and its gradient with respect to the corners.

use crate::{
    face::Face,
    lanes::Lanes,
    pair::Closest,
    real::{Float, Mask, Real, splat},
};

/// Faces whose doubled area (NDC²) is at most this have no interior: their nearest points are on the boundary. A pixel centre hardly ever
/// lies in such a face, and dividing by its area would leave the range of f32.
pub const AREA: f64 = 1e-15;

/// Barycentric weights of a face on the screen, `constant + x px + y py` each, in all lanes; and whether its area is large enough to divide
/// by. `least_area` is [`AREA`] in pixels.
#[inline(always)]
pub(super) fn planes<T: Real>(face: Face<T>, least_area: Float<T>) -> ([[T; 3]; 3], bool) {
    let zero = T::constant(splat(0.0));
    let [mut constant, mut x, mut y] = [[zero; 3]; 3];
    let mut area = zero;
    for k in 0..3 {
        // The doubled area of the triangle of pixel and edge, opposite corner k + 2.
        let edge = face.edge(k);
        let corner = (k + 2) % 3;
        constant[corner] = edge.to_y * edge.x - edge.to_x * edge.y;
        (x[corner], y[corner]) = (zero - edge.to_y, edge.to_x);
        area = area + constant[corner];
    }
    let some = area.value().array()[0] > least_area;
    let one = T::constant(splat(1.0));
    let per_area = if some { area } else { one }.inverse();
    for k in 0..3 {
        (constant[k], x[k], y[k]) = (constant[k] * per_area, x[k] * per_area, y[k] * per_area);
    }
    ([constant, x, y], some)
}

/// Nearest points of a face to eight pixels: the pixels themselves where they lie in it, else the closest points of its boundary.
#[derive(Clone, Copy)]
pub(super) struct Point<T: Real> {
    /// The closest point of the boundary: the offset from it to the pixel, its position on its edge, its barycentric weights, and its edge.
    offset: [T; 2],
    along: T,
    weights: [T; 3],
    edges: [Mask<T>; 3],
    /// Barycentric weights of the nearest point of the face, on the screen.
    pub(super) barycentric: [T; 3],
    /// The pixels that are their own nearest point.
    within: Mask<T>,
    /// The vector of the closest point's edge, and one over its squared length.
    edge: [T; 2],
    inverse: T,
}

impl<T: Real> Point<T> {
    /// A placeholder before any point is known.
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        let zero = T::constant(splat(0.0));
        let nowhere = splat::<T::Lanes>(0.0).less(splat(0.0));
        Self {
            offset: [zero; 2],
            along: zero,
            weights: [zero; 3],
            edges: [nowhere; 3],
            barycentric: [zero; 3],
            within: nowhere,
            edge: [zero; 2],
            inverse: zero,
        }
    }

    /// Nearest points of a face. `closest` are the closest points of its boundary, `own` the barycentric weights of the pixels themselves,
    /// valid if `some`.
    #[inline(always)]
    pub(super) fn new(closest: &Closest<T>, face: Face<T>, own: [T; 3], some: bool) -> Self {
        let Closest { dx, dy, along, weights, inside, edges, .. } = *closest;
        let limit = splat::<T::Lanes>(if some { 1.0 } else { 0.0 });
        let one = splat::<T::Lanes>(1.0).only(inside);
        let within = splat::<T::Lanes>(0.5).less(one.min(limit));
        let mut barycentric = weights;
        for k in 0..3 {
            barycentric[k] = T::choose(within, own[k], barycentric[k]);
        }
        let edge = face.chosen_by(edges);
        Self {
            offset: [dx, dy],
            along,
            weights,
            edges,
            barycentric,
            within,
            edge: [edge.to_x, edge.to_y],
            inverse: edge.inverse,
        }
    }

    /// Gradient with respect to x and y of the three corners in pixels, given the derivatives of a function with respect to the squared
    /// distance and to the barycentric weights. `planes_x` and `planes_y` are the slopes of these weights along x and y.
    ///
    /// The closest point of the boundary minimises the distance, so the squared distance changes as if the point kept its position on its
    /// edge. If corner m moves by δ, a pixel `p = Σ λₖ aₖ` stays but the material point at p moves by `λₘ δ`; `λₖ` therefore changes by
    /// `-λₘ ∇λₖ · δ`. A point at position t of an edge e moves along it by `(δ · d + ..) / |e|²`, where d is the offset from it to the
    /// pixel.
    #[inline(always)]
    pub(super) fn pulled(
        &self,
        [planes_x, planes_y]: [[T; 3]; 2],
        by_distance2: T,
        by_weights: [T; 3],
    ) -> [T; 6] {
        let zero = T::constant(splat(0.0));
        let [w0, w1, w2] = by_weights;
        let Self { offset: [dx, dy], along, weights, edges, .. } = *self;
        let [on_first, on_second, on_third] = edges;
        // For the pixel itself.
        let field_x = w0 * planes_x[0] + w1 * planes_x[1] + w2 * planes_x[2];
        let field_y = w0 * planes_y[0] + w1 * planes_y[1] + w2 * planes_y[2];
        // For a point of an edge that is not clamped to one of its ends.
        let slide = (w1 - w0).masked(on_first) + (w2 - w1).masked(on_second);
        let slide = slide + (w0 - w2).masked(on_third);
        let free = slide.masked(splat::<T::Lanes>(0.0).less(along.value()));
        let free = free.masked(along.value().less(splat(1.0)));
        let slide = T::choose(self.within, zero, free) * self.inverse;
        let field_x = T::choose(self.within, field_x, slide * self.edge[0]);
        let field_y = T::choose(self.within, field_y, slide * self.edge[1]);
        let (across_x, across_y) = (turned(edges, slide * dx), turned(edges, slide * dy));
        let pull = by_distance2.scale(splat(-2.0));
        let (pull_x, pull_y) = (pull * dx, pull * dy);
        let mut corners = [zero; 6];
        for k in 0..3 {
            let (weight, own) = (weights[k], self.barycentric[k]);
            corners[2 * k] = pull_x * weight - field_x * own + across_x[k];
            corners[2 * k + 1] = pull_y * weight - field_y * own + across_y[k];
        }
        corners
    }
}

/// Distributes a push, against the first corner of an edge and towards its second, over the corners of the face. A function, since closures
/// lack the target features of their callers.
#[inline(always)]
fn turned<T: Real>([first, second, third]: [Mask<T>; 3], push: T) -> [T; 3] {
    let (first, second, third) = (push.masked(first), push.masked(second), push.masked(third));
    [third - first, first - second, second - third]
}
