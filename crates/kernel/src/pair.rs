//! The arithmetic of eight pixels and one face.

use super::{
    face::{Edge, Face},
    float::Float as _,
    lanes::Lanes,
    real::{Mask, Real, splat},
};

/// Closest points of a triangle's boundary to eight pixels.
#[derive(Clone, Copy)]
pub(crate) struct Closest<T: Real> {
    /// Squared distance to the closest point, in pixels².
    pub(crate) distance2: T,
    /// Offset from the closest point to the pixel.
    pub(crate) dx: T,
    pub(crate) dy: T,
    /// Barycentric weights of the closest point.
    pub(crate) weights: [T; 3],
    /// The pixels that lie in the triangle, edges included.
    pub(crate) inside: Mask<T>,
    /// Position of the closest point on its edge, 0 to 1, and the pixels for which this is the first, the second and the third edge.
    pub(crate) along: T,
    pub(crate) edges: [Mask<T>; 3],
}

impl<T: Real> Closest<T> {
    /// A placeholder before any point is known.
    #[inline(always)]
    pub(crate) fn nothing() -> Self {
        let zero = T::constant(splat(0.0));
        let nowhere = splat::<T::Lanes>(0.0).less(splat(0.0));
        Self {
            distance2: zero,
            dx: zero,
            dy: zero,
            weights: [zero; 3],
            inside: nowhere,
            along: zero,
            edges: [nowhere; 3],
        }
    }
}

/// Closest boundary points to the pixels at `px`, `py`, by projection onto edges. No inverted matrix, no division: slivers, points and
/// pixels on an edge all give finite numbers.
///
/// Without `SLIVERS`, only the edge whose line has the least signed distance is used: it holds the closest point (proof: docs/notes.md,
/// Nearest edge). Rounding confuses edges only where they are nearly parallel.
#[inline(always)]
pub(crate) fn closest<T: Real, const SLIVERS: bool>(
    face: Face<T>,
    px: T::Lanes,
    py: T::Lanes,
) -> Closest<T> {
    let (second, third, point, side);
    if SLIVERS {
        let points = [
            Point::of(face.edge(0), px, py),
            Point::of(face.edge(1), px, py),
            Point::of(face.edge(2), px, py),
        ];
        let [first, other, last] = &points;
        second = other.distance2.value().less(first.distance2.value());
        let nearer = Point::choose(second, other, first);
        third = last.distance2.value().less(nearer.distance2.value());
        point = Point::choose(third, last, &nearer);
        // A triangle without area has no inside.
        let most = splat(if face.is_solid() { 1.0 } else { -1.0 });
        side = first.side.min(other.side).min(last.side).min(most);
    } else {
        let lines = [face.line(0, px, py), face.line(1, px, py), face.line(2, px, py)];
        let two = lines[0].min(lines[1]);
        (second, third) = (lines[1].less(lines[0]), lines[2].less(two));
        point = Point::of(face.chosen(T::Lanes::which(second, third)), px, py);
        side = point.side;
    }
    // Not from the lines: they are inexact for a pixel that lies on an edge.
    let inside = splat::<T::Lanes>(0.0).at_most(side);
    // Corner k starts edge k and ends edge k - 1.
    let edges = T::Lanes::where_each(second, third);
    let [on_first, on_second, on_third] = edges;
    let along = point.along;
    let rest = T::constant(splat(1.0)) - along;
    let weights = [
        rest.masked(on_first) + along.masked(on_third),
        along.masked(on_first) + rest.masked(on_second),
        along.masked(on_second) + rest.masked(on_third),
    ];
    let Point { distance2, dx, dy, .. } = point;
    Closest { distance2, dx, dy, weights, inside, along, edges }
}

/// The gradient of a sum with respect to the corners of a face, chunk by chunk.
///
/// The closest point minimises the distance, so the squared distance changes as if the point kept its position on its edge: by -2 times the
/// offset from it to the pixel, distributed over the corners by the barycentric weights of the point.
#[derive(Clone, Copy)]
pub(crate) struct CornerSums<L>([L; 6]);

impl<L: Lanes> CornerSums<L> {
    #[inline(always)]
    pub(crate) fn nothing() -> Self {
        Self([splat(0.0); 6])
    }

    /// Adds the offsets from the closest points to the pixels times the derivatives with respect to the squared distance, `x` and `y`;
    /// `second` and `third` are the weights of the points on these corners.
    #[inline(always)]
    pub(crate) fn add<T: Real<Lanes = L>>(&mut self, [x, y]: [T; 2], [second, third]: [T; 2]) {
        self.0[0] += x.output();
        self.0[1] += y.output();
        self.0[2] += (x * second).output();
        self.0[3] += (y * second).output();
        self.0[4] += (x * third).output();
        self.0[5] += (y * third).output();
    }

    /// Adds the sums to the x and y of the three corners of a face, in NDC, and resets them. `order` are the original numbers of the
    /// corners, `half` is the number of pixels in a unit.
    #[inline(always)]
    pub(crate) fn flush(&mut self, order: [usize; 3], half: f64, corners: &mut [L::Float; 6]) {
        let sums = std::mem::replace(self, Self::nothing()).0;
        // From pixels, with y down, to NDC.
        let [right, down] = [-2.0, 2.0].map(|k| L::Float::from_f64(k * half));
        // The first corner gets the remainder.
        let first = [sums[0] - sums[2] - sums[4], sums[1] - sums[3] - sums[5]];
        let sums = L::sums([first[0], first[1], sums[2], sums[3], sums[4], sums[5]]);
        for (&corner, [x, y]) in order.iter().zip(sums.as_chunks().0) {
            corners[2 * corner] += *x * right;
            corners[2 * corner + 1] += *y * down;
        }
    }
}

/// The closest point of an edge.
struct Point<T: Real> {
    distance2: T,
    dx: T,
    dy: T,
    /// Position on the edge, 0 to 1.
    along: T,
    /// Twice the area of the triangle of edge and pixel: above 0 on the inner side.
    side: T::Lanes,
}

impl<T: Real> Point<T> {
    #[inline(always)]
    fn of(edge: Edge<T>, px: T::Lanes, py: T::Lanes) -> Self {
        let (wx, wy) = (T::constant(px) - edge.x, T::constant(py) - edge.y);
        let along = ((wx * edge.to_x + wy * edge.to_y) * edge.inverse).clamped();
        let (dx, dy) = (wx - along * edge.to_x, wy - along * edge.to_y);
        let side = edge.to_x.value() * wy.value() - edge.to_y.value() * wx.value();
        Self { distance2: dx * dx + dy * dy, dx, dy, along, side }
    }

    #[inline(always)]
    fn choose(mask: Mask<T>, yes: &Self, no: &Self) -> Self {
        Self {
            distance2: T::choose(mask, yes.distance2, no.distance2),
            dx: T::choose(mask, yes.dx, no.dx),
            dy: T::choose(mask, yes.dy, no.dy),
            along: T::choose(mask, yes.along, no.along),
            side: no.side,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        face::{Faces, prepare},
        float::Float,
        lanes::{LANES, Plain},
    };

    /// Distances from pixels to triangles with and without `SLIVERS`, and both results for the inside.
    fn both<F: Float>(
        triangle: [[f64; 2]; 3],
        pixels: &[[f64; 2]],
    ) -> (bool, Vec<[(f64, bool); 2]>) {
        let axis = |k: usize| triangle.map(|corner| Plain::splat(F::from_f64(corner[k])));
        let mut faces = Faces::<Plain<F>>::nothing();
        prepare(axis(0), axis(1), splat(0.1), 1.0, &mut faces);
        let face = faces.face(0);
        let at = |x: f64| Plain::splat(F::from_f64(x));
        let of = |point: Closest<Plain<F>>| {
            (point.distance2.array()[0].to_f64().sqrt(), point.inside[LANES - 1])
        };
        let ways = |&[x, y]: &[f64; 2]| {
            [
                of(closest::<_, true>(face, at(x), at(y))),
                of(closest::<_, false>(face, at(x), at(y))),
            ]
        };
        (faces.any_sliver(1), pixels.iter().map(ways).collect())
    }

    fn assert_same<F: Float>(bound: f64) {
        let wave = |k: usize| (1.7 * k as f64).sin();
        let pixels: Vec<_> = (0..400).map(|k| [2.0 * wave(3 * k + 1), 2.0 * wave(5 * k)]).collect();
        let mut stout = 0;
        for k in 0..600 {
            let [a, b] = [[wave(k), wave(2 * k + 7)], [wave(5 * k + 1), wave(7 * k + 3)]];
            // The third corner comes as close to the first edge as triangles that are no slivers allow.
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
