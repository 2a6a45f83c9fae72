//! Projected triangles, eight at a time: their edges, and the pixels of a row that their support can reach.

use super::{
    float::Float as _,
    lanes::{LANES, Lanes},
    reach::{FAR_AWAY, Reach},
    real::{Float, Real, splat},
};
use crate::ImageSize;

/// Edge vectors shorter than this (NDC², squared length) count as a point.
const POINT: f64 = 1e-30;
/// Edges whose slope is below this bound no column.
const FLAT: f64 = 1e-3;
/// Triangles lower than this part of their longest edge count as slivers.
const SLIVER: f64 = 1e-3;
/// What makes up for the rounding of a column, in pixels.
const MARGIN: f64 = 0.01;

/// Triangles prepared for distances, one a lane; corner k starts edge k, and all turn counterclockwise.
///
/// Meshes have faces of a few pixels, so that what a face costs before its first pixel counts.
pub(crate) struct Faces<T: Real> {
    x: [T::Stored; 3],
    y: [T::Stored; 3],
    edge_x: [T::Stored; 3],
    edge_y: [T::Stored; 3],
    inverse: [T::Stored; 3],
    inverse_length: [[Float<T>; LANES]; 3],
    most: [Float<T>; LANES],
    /// Whether some are slivers or have no area.
    pub(crate) slivers: bool,
    /// Whether corners 1 and 2 have changed places: above 0 where they have.
    turned: [Float<T>; LANES],
    // Edge k asks for x >= low[k] + tilt[k] * y and x <= high[k] + tilt[k] * y; one of the two is
    // out of reach.
    low: [[Float<T>; LANES]; 3],
    high: [[Float<T>; LANES]; 3],
    tilt: [[Float<T>; LANES]; 3],
}

/// One of them, in all lanes.
pub(crate) struct Face<T: Real> {
    pub(crate) x: [T; 3],
    pub(crate) y: [T; 3],
    pub(crate) edge_x: [T; 3],
    pub(crate) edge_y: [T; 3],
    /// One over the squared length of each edge; 0 for an edge that is a point.
    pub(crate) inverse: [T; 3],
    /// One over the length of each edge.
    pub(crate) inverse_length: [T::Lanes; 3],
    /// What the least of the three edge functions may be at most: -1 for a triangle without area,
    /// which has no inside.
    pub(crate) most: T::Lanes,
}

impl<T: Real> Faces<T> {
    /// Prepares triangles with these corners (NDC) for pixels no farther outside than the `radius` of each.
    #[inline(always)]
    pub(crate) fn new(x: [T; 3], y: [T; 3], radius: T::Lanes) -> Self {
        let zero = splat::<T::Lanes>(0.0);
        let area = (x[1] - x[0]).value() * (y[2] - y[0]).value()
            - (y[1] - y[0]).value() * (x[2] - x[0]).value();
        let turned = area.less(zero);
        let x = [x[0], T::choose(turned, x[2], x[1]), T::choose(turned, x[1], x[2])];
        let y = [y[0], T::choose(turned, y[2], y[1]), T::choose(turned, y[1], y[2])];
        let area = area.max(area.neg());
        let solid = zero.less(area);
        let mut longest = zero;
        let pick = <T::Lanes as Lanes>::pick;
        let none = [T::Stored::default(); 3];
        let nothing = [[Float::<T>::ZERO; LANES]; 3];
        let mut faces = Self {
            x: none,
            y: none,
            edge_x: none,
            edge_y: none,
            inverse: none,
            inverse_length: nothing,
            most: pick(solid, splat(1.0), splat(-1.0)).array(),
            slivers: false,
            turned: splat::<T::Lanes>(1.0).only(turned).array(),
            low: nothing,
            high: nothing,
            tilt: nothing,
        };
        for k in 0..3 {
            let (edge_x, edge_y) = (x[(k + 1) % 3] - x[k], y[(k + 1) % 3] - y[k]);
            let length2 = edge_x * edge_x + edge_y * edge_y;
            let some = splat::<T::Lanes>(POINT).less(length2.value());
            let inverse = T::choose(some, length2, T::constant(splat(1.0))).inverse().masked(some);
            (faces.x[k], faces.y[k]) = (x[k].store(), y[k].store());
            (faces.edge_x[k], faces.edge_y[k]) = (edge_x.store(), edge_y.store());
            faces.inverse[k] = inverse.store();
            faces.inverse_length[k] = inverse.value().sqrt().array();
            longest = length2.value().max(longest);

            // ex (py - y) - ey (px - x) >= -radius |e|, solved for px. The bound is of no use for an edge
            // that is all but horizontal, or for a face without area.
            let (ex, ey) = (edge_x.value().only(solid), edge_y.value().only(solid));
            let flat = splat::<T::Lanes>(FLAT * FLAT) * ex * ex;
            let useful = flat.less(ey * ey);
            let tilt = (ex * Lanes::recip(pick(useful, ey, splat(1.0)))).only(useful);
            let reach = radius * (splat::<T::Lanes>(1.0) + tilt * tilt).sqrt();
            let bound = x[k].value() - tilt * y[k].value();
            let never = splat::<T::Lanes>(FAR_AWAY);
            let low = pick(ey.less(zero), bound - reach, never.neg());
            let high = pick(zero.less(ey), bound + reach, never);
            faces.tilt[k] = tilt.array();
            faces.low[k] = pick(useful, low, never.neg()).array();
            faces.high[k] = pick(useful, high, never).array();
        }
        let stout = (splat::<T::Lanes>(SLIVER) * longest).less(area);
        faces.slivers = pick(stout, zero, splat(1.0)).sum() > Float::<T>::ZERO;
        faces
    }

    /// The face of a lane.
    #[inline(always)]
    pub(crate) fn face(&self, lane: usize) -> Face<T> {
        Face {
            x: of_lane(&self.x, lane),
            y: of_lane(&self.y, lane),
            edge_x: of_lane(&self.edge_x, lane),
            edge_y: of_lane(&self.edge_y, lane),
            inverse: of_lane(&self.inverse, lane),
            inverse_length: [
                T::Lanes::splat(self.inverse_length[0][lane % LANES]),
                T::Lanes::splat(self.inverse_length[1][lane % LANES]),
                T::Lanes::splat(self.inverse_length[2][lane % LANES]),
            ],
            most: T::Lanes::splat(self.most[lane % LANES]),
        }
    }

    /// The corners of a lane as they were given, by their places here.
    #[inline(always)]
    pub(crate) fn corners(&self, lane: usize) -> [usize; 3] {
        if self.turned[lane % LANES] > Float::<T>::ZERO { [0, 2, 1] } else { [0, 1, 2] }
    }

    /// Columns that all three edges of a lane allow in the rows at heights `y`, within the columns of
    /// `reach`: first column and the one after the last.
    #[inline(always)]
    pub(crate) fn columns(
        &self,
        lane: usize,
        y: &[Float<T>; LANES],
        reach: Reach,
        size: ImageSize,
    ) -> ([i32; LANES], [i32; LANES]) {
        let y = <T::Lanes as Lanes>::of(y);
        let lane = lane % LANES;
        let number = |column: u32| -> T::Lanes { splat(f64::from(column)) };
        let (left, right) = (number(reach.left), number(reach.right));
        let (mut low, mut high) = (splat::<T::Lanes>(-FAR_AWAY), splat::<T::Lanes>(FAR_AWAY));
        for k in 0..3 {
            let shift = T::Lanes::splat(self.tilt[k][lane]) * y;
            low = (T::Lanes::splat(self.low[k][lane]) + shift).max(low);
            high = (T::Lanes::splat(self.high[k][lane]) + shift).min(high);
        }
        // The first centre at or after low, and the one after the last at or before high.
        let half = splat::<T::Lanes>(0.5 * size.shorter() as f64);
        let middle = 0.5 * (size.width as f64 - 1.0) + 0.5;
        let low = low * half + splat(middle - MARGIN);
        let high = high * half + splat(middle + MARGIN);
        let (starts, ends) = (low.max(left).min(right), high.min(right).max(splat(0.0)));
        (starts.nearest(), ends.nearest())
    }
}

/// What three edges or corners have in a lane. Written out: `map` on an array is a call.
#[inline(always)]
fn of_lane<T: Real>([a, b, c]: &[T::Stored; 3], lane: usize) -> [T; 3] {
    [T::of_lane(a, lane), T::of_lane(b, lane), T::of_lane(c, lane)]
}
