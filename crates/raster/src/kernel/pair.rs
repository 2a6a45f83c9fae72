//! The arithmetic of eight pixels and one face.

use super::{
    face::Face,
    lanes::Lanes,
    real::{Mask, Real, splat},
};

/// Closest points of a triangle's boundary to eight pixels.
pub(crate) struct Closest<T: Real> {
    /// Squared distance to it, NDC².
    pub(crate) distance2: T,
    /// From it to the pixel.
    pub(crate) dx: T,
    pub(crate) dy: T,
    /// Its barycentric weights.
    pub(crate) weights: [T; 3],
    /// Where the pixel lies in the triangle, edges included.
    pub(crate) inside: Mask<T>,
}

/// Closest boundary points to the pixels at `px`, `py` (NDC), by projection onto edges. No inverted matrix, no division:
/// slivers, points and pixels on an edge all give finite numbers.
///
/// Without `SLIVERS`, only onto the edge whose line has the least signed distance: it has the closest point. For let p be the
/// pixel, q its closest point at distance d. If q is the foot on an edge, no line of the triangle that q is inside of
/// can be more than d beyond p. If q is a corner, so is it on both of its edges, and p - q a sum of their outward normals with
/// factors from 0 up: the larger of its products with these two normals is at least that with the third, which is minus their
/// sum weighted by the lengths of the edges. Rounding confuses edges only where they are all but parallel.
#[inline(always)]
pub(crate) fn closest<T: Real, const SLIVERS: bool>(
    face: &Face<T>,
    px: T::Lanes,
    py: T::Lanes,
) -> Closest<T> {
    let a = Edge::seen_from(face, 0, px, py);
    let b = Edge::seen_from(face, 1, px, py);
    let c = Edge::seen_from(face, 2, px, py);
    let side = a.side.min(b.side).min(c.side).min(face.most);
    let inside = splat::<T::Lanes>(0.0).at_most(side);
    let (second, third, point);
    if SLIVERS {
        let points = [a.point(), b.point(), c.point()];
        let [first, other, last] = &points;
        second = other.distance2.value().less(first.distance2.value());
        let nearer = Point::choose(second, other, first);
        third = last.distance2.value().less(nearer.distance2.value());
        point = Point::choose(third, last, &nearer);
    } else {
        second = b.line.less(a.line);
        third = c.line.less(b.line.min(a.line));
        point = Edge::choose(third, &c, &Edge::choose(second, &b, &a)).point();
    }
    // Corner k starts edge k and ends edge k - 1.
    let (zero, along) = (T::constant(splat(0.0)), point.along);
    let rest = T::constant(splat(1.0)) - along;
    let weights = [
        T::choose(third, along, T::choose(second, zero, rest)),
        T::choose(third, zero, T::choose(second, rest, along)),
        T::choose(third, rest, along.masked(second)),
    ];
    Closest { distance2: point.distance2, dx: point.dx, dy: point.dy, weights, inside }
}

/// An edge as pixels see it.
struct Edge<T: Real> {
    /// From its first corner to the pixel.
    wx: T,
    wy: T,
    /// From its first corner to its second.
    x: T,
    y: T,
    /// One over its squared length.
    inverse: T,
    /// Twice the area of the triangle that edge and pixel make: above 0 on the inner side.
    side: T::Lanes,
    /// Signed distance to its line.
    line: T::Lanes,
}

/// The closest point of an edge.
struct Point<T: Real> {
    distance2: T,
    dx: T,
    dy: T,
    /// Its place on the edge, 0 to 1.
    along: T,
}

impl<T: Real> Edge<T> {
    #[inline(always)]
    fn seen_from(face: &Face<T>, k: usize, px: T::Lanes, py: T::Lanes) -> Self {
        let (x, y) = (face.edge_x[k], face.edge_y[k]);
        let (wx, wy) = (T::constant(px) - face.x[k], T::constant(py) - face.y[k]);
        let side = x.value() * wy.value() - y.value() * wx.value();
        Self { wx, wy, x, y, inverse: face.inverse[k], side, line: side * face.inverse_length[k] }
    }

    #[inline(always)]
    fn choose(mask: Mask<T>, yes: &Self, no: &Self) -> Self {
        let pick = <T::Lanes as Lanes>::pick;
        Self {
            wx: T::choose(mask, yes.wx, no.wx),
            wy: T::choose(mask, yes.wy, no.wy),
            x: T::choose(mask, yes.x, no.x),
            y: T::choose(mask, yes.y, no.y),
            inverse: T::choose(mask, yes.inverse, no.inverse),
            side: pick(mask, yes.side, no.side),
            line: pick(mask, yes.line, no.line),
        }
    }

    #[inline(always)]
    fn point(&self) -> Point<T> {
        let along = ((self.wx * self.x + self.wy * self.y) * self.inverse).clamped();
        let (dx, dy) = (self.wx - along * self.x, self.wy - along * self.y);
        Point { distance2: dx * dx + dy * dy, dx, dy, along }
    }
}

impl<T: Real> Point<T> {
    #[inline(always)]
    fn choose(mask: Mask<T>, yes: &Self, no: &Self) -> Self {
        Self {
            distance2: T::choose(mask, yes.distance2, no.distance2),
            dx: T::choose(mask, yes.dx, no.dx),
            dy: T::choose(mask, yes.dy, no.dy),
            along: T::choose(mask, yes.along, no.along),
        }
    }
}
