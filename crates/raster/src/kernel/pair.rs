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
/// Without `SLIVERS`, only onto the edge whose line has the least signed distance: it holds the closest point. docs/notes.md, Nearest
/// edge, has the proof. Rounding confuses edges only where they are all but parallel.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{
        face::Faces,
        float::Float,
        lanes::{LANES, Plain},
    };

    /// Distances from pixels to triangles by both ways, and what both say of the inside.
    fn both<F: Float>(
        triangle: [[f64; 2]; 3],
        pixels: &[[f64; 2]],
    ) -> (bool, Vec<[(f64, bool); 2]>) {
        let axis = |k: usize| triangle.map(|corner| Plain::splat(F::from_f64(corner[k])));
        let faces = Faces::<Plain<F>>::new(axis(0), axis(1), splat(0.1));
        let face = faces.face(0);
        let at = |x: f64| Plain::splat(F::from_f64(x));
        let of = |point: Closest<Plain<F>>| {
            (point.distance2.array()[0].to_f64().sqrt(), point.inside[LANES - 1])
        };
        let ways = |&[x, y]: &[f64; 2]| {
            [
                of(closest::<_, true>(&face, at(x), at(y))),
                of(closest::<_, false>(&face, at(x), at(y))),
            ]
        };
        (faces.slivers, pixels.iter().map(ways).collect())
    }

    fn assert_same<F: Float>(bound: f64) {
        let wave = |k: usize| (1.7 * k as f64).sin();
        let pixels: Vec<_> = (0..400).map(|k| [2.0 * wave(3 * k + 1), 2.0 * wave(5 * k)]).collect();
        let mut stout = 0;
        for k in 0..600 {
            let [a, b] = [[wave(k), wave(2 * k + 7)], [wave(5 * k + 1), wave(7 * k + 3)]];
            // The third corner comes as near to the first edge as triangles that are no slivers allow.
            let height = 10f64.powf(-3.5 * (k as f64 / 600.0));
            let along = 1.5 * wave(11 * k);
            let (x, y) = (b[0] - a[0], b[1] - a[1]);
            let c = [a[0] + along * x - height * y, a[1] + along * y + height * x];
            let (slivers, ways) = both::<F>([a, b, c], &pixels);
            stout += usize::from(!slivers);
            for [all, one] in ways.into_iter().filter(|_| !slivers) {
                assert!((all.0 - one.0).abs() <= bound, "{k}: {} instead of {}", one.0, all.0);
                assert_eq!(all.1, one.1);
            }
        }
        assert!((300..600).contains(&stout), "{stout} are no slivers");
    }

    #[test]
    fn the_edge_with_the_least_signed_distance_is_the_nearest() {
        assert_same::<f64>(1e-12);
        assert_same::<f32>(2e-6);
    }
}
