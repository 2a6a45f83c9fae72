//! The point of a face nearest to a pixel, and what moves it.

use crate::kernel::{
    face::Face,
    lanes::Lanes,
    real::{Mask, Real, splat},
};

/// Faces whose doubled area (NDC²) is no more than this have no inside that counts: their points are those of their boundary. No pixel's
/// centre lies in such a face but by chance, and dividing by its area would leave the range of f32.
pub(crate) const AREA: f64 = 1e-15;

/// Nearest points of a face to eight pixels: the pixels themselves where they lie in it, else the closest points of its boundary.
pub(super) struct Point<T: Real> {
    /// Squared distance to the boundary, NDC².
    pub(super) distance2: T,
    /// From the closest point of the boundary to the pixel.
    dx: T,
    dy: T,
    /// Barycentric weights of the closest point of the boundary.
    weights: [T; 3],
    /// Where the pixel lies in the face, edges included.
    pub(super) inside: Mask<T>,
    /// Barycentric weights of the nearest point of the face, on the screen.
    pub(super) barycentric: [T; 3],
    /// Where the nearest point is the pixel itself.
    within: Mask<T>,
    /// One over the doubled area, where the nearest point is the pixel itself.
    per_area: T,
    /// Place of the closest point on its edge, that edge, and one over its squared length.
    along: T,
    edge_x: T,
    edge_y: T,
    inverse: T,
    /// Which edge it is.
    which: Which<T>,
}

/// Which edge is the nearest: the third where the second mask holds, else the second where the first does, else the first.
type Which<T> = [Mask<T>; 2];

/// What one of three edges has. A function, since closures have not the features of their callers.
#[inline(always)]
fn pick<T: Real>([second, third]: Which<T>, a: T, b: T, c: T) -> T {
    T::choose(third, c, T::choose(second, b, a))
}

/// What pushes the first corner of an edge one way and its second the other does to the corners.
#[inline(always)]
fn turned<T: Real>(which: Which<T>, push: T) -> [T; 3] {
    let zero = T::constant(splat(0.0));
    let back = zero - push;
    [pick(which, back, zero, push), pick(which, push, back, zero), pick(which, zero, push, back)]
}

/// An edge as pixels see it, and its closest point.
struct Edge<T: Real> {
    distance2: T,
    dx: T,
    dy: T,
    along: T,
    /// The doubled area of the triangle that edge and pixel make: above 0 on the inner side.
    side: T,
}

impl<T: Real> Edge<T> {
    #[inline(always)]
    fn new(face: &Face<T>, k: usize, px: T::Lanes, py: T::Lanes) -> Self {
        let (x, y) = (face.edge_x[k], face.edge_y[k]);
        let (wx, wy) = (T::constant(px) - face.x[k], T::constant(py) - face.y[k]);
        let along = ((wx * x + wy * y) * face.inverse[k]).clamped();
        let (dx, dy) = (wx - along * x, wy - along * y);
        Self { distance2: dx * dx + dy * dy, dx, dy, along, side: x * wy - y * wx }
    }
}

impl<T: Real> Point<T> {
    /// Nearest points to the pixels at `px`, `py` (NDC).
    #[inline(always)]
    pub(super) fn new(face: &Face<T>, px: T::Lanes, py: T::Lanes) -> Self {
        let zero = T::constant(splat(0.0));
        let a = Edge::new(face, 0, px, py);
        let b = Edge::new(face, 1, px, py);
        let c = Edge::new(face, 2, px, py);
        let second = b.distance2.value().less(a.distance2.value());
        let nearer = T::choose(second, b.distance2, a.distance2);
        let third = c.distance2.value().less(nearer.value());
        let which = [second, third];
        let along = pick(which, a.along, b.along, c.along);
        let rest = T::constant(splat(1.0)) - along;
        // Corner k starts edge k and ends edge k - 1.
        let weights = [
            pick(which, rest, zero, along),
            pick(which, along, rest, zero),
            pick(which, zero, along, rest),
        ];
        let least = a.side.value().min(b.side.value()).min(c.side.value()).min(face.most);
        let inside = splat::<T::Lanes>(0.0).at_most(least);
        // The three add up to the doubled area. Where the pixel is in the face none of them is below 0, and so is no weight.
        let area = (a.side + b.side + c.side).masked(inside);
        let within = splat::<T::Lanes>(AREA).less(area.value());
        let per_area = T::choose(within, area, T::constant(splat(1.0))).inverse();
        Self {
            distance2: pick(which, a.distance2, b.distance2, c.distance2),
            dx: pick(which, a.dx, b.dx, c.dx),
            dy: pick(which, a.dy, b.dy, c.dy),
            weights,
            inside,
            // Corner k lies across from edge k + 1.
            barycentric: [
                T::choose(within, b.side * per_area, weights[0]),
                T::choose(within, c.side * per_area, weights[1]),
                T::choose(within, a.side * per_area, weights[2]),
            ],
            within,
            per_area,
            along,
            edge_x: pick(which, face.edge_x[0], face.edge_x[1], face.edge_x[2]),
            edge_y: pick(which, face.edge_y[0], face.edge_y[1], face.edge_y[2]),
            inverse: pick(which, face.inverse[0], face.inverse[1], face.inverse[2]),
            which,
        }
    }

    /// Gradient to x and y of the three corners, of a function with these derivatives by the squared distance and by the barycentric
    /// weights.
    ///
    /// The closest point of the boundary is where it is closest, so the squared distance moves as though the point stayed on its edge
    /// where it is. A pixel `p = Σ λₖ aₖ` stays while corner m moves by δ, and with it all that lies at p by `λₘ δ`; so `λₖ` changes by
    /// `-λₘ ∇λₖ · δ`. A point of an edge e, at the place t, moves along by `(δ · d + ..) / |e|²`, d being from it to the pixel.
    #[inline(always)]
    pub(super) fn pulled(&self, face: &Face<T>, by_distance2: T, by_weights: [T; 3]) -> [T; 6] {
        let zero = T::constant(splat(0.0));
        let [w0, w1, w2] = by_weights;
        // Of the pixel itself: `∇λₖ` is the edge across, turned, over the doubled area.
        let (e, f) = (&face.edge_x, &face.edge_y);
        let field_x = (zero - (w0 * f[1] + w1 * f[2] + w2 * f[0])) * self.per_area;
        let field_y = (w0 * e[1] + w1 * e[2] + w2 * e[0]) * self.per_area;
        // Of a point of an edge that is not held at one of its ends.
        let slide = pick(self.which, w1 - w0, w2 - w1, w0 - w2);
        let free = slide.masked(splat::<T::Lanes>(0.0).less(self.along.value()));
        let free = free.masked(self.along.value().less(splat(1.0)));
        let slide = T::choose(self.within, zero, free) * self.inverse;
        let field_x = T::choose(self.within, field_x, slide * self.edge_x);
        let field_y = T::choose(self.within, field_y, slide * self.edge_y);
        let (across_x, across_y) = (slide * self.dx, slide * self.dy);
        let (across_x, across_y) = (turned(self.which, across_x), turned(self.which, across_y));
        let pull = by_distance2.scale(splat(-2.0));
        let (pull_x, pull_y) = (pull * self.dx, pull * self.dy);
        let mut corners = [zero; 6];
        for k in 0..3 {
            let (weight, own) = (self.weights[k], self.barycentric[k]);
            corners[2 * k] = pull_x * weight - field_x * own + across_x[k];
            corners[2 * k + 1] = pull_y * weight - field_y * own + across_y[k];
        }
        corners
    }
}
