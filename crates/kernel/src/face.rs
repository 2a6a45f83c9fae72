//! Projected triangles, eight at a time: their edges, and the pixels of a row that their support can reach.
//!
//! Lengths are in pixels, x to the right and y down, relative to the centre of a pixel near the face: pixel centres are whole numbers, and
//! the corners of the face keep their digits.
#![allow(clippy::needless_range_loop)]

use super::{
    float::Float as _,
    lanes::{LANES, Lanes},
    reach::FAR_AWAY,
    real::{Float, Mask, Real, Which, splat},
};

/// Edge vectors shorter than this (NDC², squared length) count as a point.
const POINT: f64 = 1e-30;
/// Edges whose slope is below this bound no column.
const FLAT: f64 = 1e-3;
/// Triangles lower than this fraction of their longest edge count as slivers.
const SLIVER: f64 = 1e-3;
/// Margin for the rounding of a column, in pixels.
const MARGIN: f64 = 0.01;

/// Triangles prepared for distances, one a lane; corner k starts edge k, and all turn the same way.
#[derive(Clone, Copy)]
pub(crate) struct Faces<T: Real> {
    /// The signed distance to the line of edge k is `lines[0][k] + lines[1][k] x + lines[2][k] y`, above 0 on the inner side. Not for
    /// slivers.
    lines: [[[Float<T>; 4]; LANES]; 3],
    x: T::Threes,
    y: T::Threes,
    edge_x: T::Threes,
    edge_y: T::Threes,
    /// One over the squared length of each edge; 0 for an edge that is a point.
    inverse: T::Threes,
    /// Bit mask of the lanes in which corners 1 and 2 are swapped.
    turned: u32,
    /// Bit mask of the lanes that hold slivers or triangles without area.
    slivers: u32,
    /// Bit mask of the lanes that hold triangles with an area.
    solid: u32,
}

impl<T: Real> Faces<T> {
    /// A placeholder before any face is prepared.
    pub(crate) fn nothing() -> Self {
        let threes = T::Threes::default();
        Self {
            lines: [[[Float::<T>::ZERO; 4]; LANES]; 3],
            x: threes,
            y: threes,
            edge_x: threes,
            edge_y: threes,
            inverse: threes,
            turned: 0,
            slivers: 0,
            solid: 0,
        }
    }

    /// Whether one of the first `count` is a sliver.
    #[inline(always)]
    pub(crate) fn any_sliver(&self, count: usize) -> bool {
        self.slivers & ((1 << count) - 1) != 0
    }

    /// The face of a lane.
    #[inline(always)]
    pub(crate) fn face(&self, lane: usize) -> Face<'_, T> {
        Face { faces: self, lane: lane % LANES }
    }
}

/// A face of [`Faces`].
#[derive(Clone, Copy)]
pub(crate) struct Face<'a, T: Real> {
    faces: &'a Faces<T>,
    lane: usize,
}

/// An edge, the same in all lanes or one per lane.
pub(crate) struct Edge<T> {
    /// Its first corner.
    pub(crate) x: T,
    pub(crate) y: T,
    /// From there to its second corner.
    pub(crate) to_x: T,
    pub(crate) to_y: T,
    /// One over its squared length; 0 for an edge that is a point.
    pub(crate) inverse: T,
}

impl<T: Real> Face<'_, T> {
    /// The original number of each corner here.
    #[inline(always)]
    pub(crate) fn corners(&self) -> [usize; 3] {
        if self.faces.turned >> self.lane & 1 == 1 { [0, 2, 1] } else { [0, 1, 2] }
    }

    /// Whether the face has an area.
    #[inline(always)]
    pub(crate) fn is_solid(&self) -> bool {
        self.faces.solid >> self.lane & 1 == 1
    }

    /// Signed distances of pixels to the line of edge k.
    #[inline(always)]
    pub(crate) fn line(&self, k: usize, px: T::Lanes, py: T::Lanes) -> T::Lanes {
        let [start, x, y] = &self.faces.lines;
        let number = <T::Lanes as Lanes>::splat;
        let lane = self.lane;
        number(x[lane][k]) * px + number(y[lane][k]) * py + number(start[lane][k])
    }

    /// Edge k.
    #[inline(always)]
    pub(crate) fn edge(&self, k: usize) -> Edge<T> {
        let (faces, lane) = (self.faces, self.lane);
        Edge {
            x: T::of_three(&faces.x, lane, k),
            y: T::of_three(&faces.y, lane, k),
            to_x: T::of_three(&faces.edge_x, lane, k),
            to_y: T::of_three(&faces.edge_y, lane, k),
            inverse: T::of_three(&faces.inverse, lane, k),
        }
    }

    /// One edge per pixel: the third, the second or the first, where the masks hold.
    #[inline(always)]
    pub(crate) fn chosen_by(&self, [_, second, third]: [Mask<T>; 3]) -> Edge<T> {
        self.chosen(T::Lanes::which(second, third))
    }

    /// One edge per pixel.
    #[inline(always)]
    pub(crate) fn chosen(&self, which: Which<T>) -> Edge<T> {
        let (faces, lane) = (self.faces, self.lane);
        Edge {
            x: T::chosen(&faces.x, lane, which),
            y: T::chosen(&faces.y, lane, which),
            to_x: T::chosen(&faces.edge_x, lane, which),
            to_y: T::chosen(&faces.edge_y, lane, which),
            inverse: T::chosen(&faces.inverse, lane, which),
        }
    }
}

/// Rows that triangles may reach, column by column: bounds of their edges.
pub(crate) struct Spans<T: Real> {
    // Edge k requires x >= low[k] + tilt[k] * y and x <= high[k] + tilt[k] * y; one of the two bounds is out of reach.
    low: [[Float<T>; LANES]; 3],
    high: [[Float<T>; LANES]; 3],
    tilt: [[Float<T>; LANES]; 3],
}

/// Prepares triangles with these corners, one per lane, for pixels within the `radius` of each. `half` is the number of pixels in a unit of
/// NDC.
///
/// The faces of a mesh often cover few pixels, so the setup cost per face matters.
#[inline(always)]
pub(crate) fn prepare<T: Real>(
    x: [T; 3],
    y: [T; 3],
    radius: T::Lanes,
    half: f64,
    faces: &mut Faces<T>,
) -> Spans<T> {
    let zero = splat::<T::Lanes>(0.0);
    let pick = <T::Lanes as Lanes>::pick;
    let area = (x[1] - x[0]).value() * (y[2] - y[0]).value()
        - (y[1] - y[0]).value() * (x[2] - x[0]).value();
    let turned = area.less(zero);
    let x = [x[0], T::choose(turned, x[2], x[1]), T::choose(turned, x[1], x[2])];
    let y = [y[0], T::choose(turned, y[2], y[1]), T::choose(turned, y[1], y[2])];
    let area = area.max(area.neg());
    let solid = zero.less(area);
    let mut longest = zero;
    let nothing = [[Float::<T>::ZERO; LANES]; 3];
    let mut spans = Spans { low: nothing, high: nothing, tilt: nothing };
    let none = T::constant(zero);
    let (mut edge_x, mut edge_y, mut inverse) = ([none; 3], [none; 3], [none; 3]);
    let mut lines = [[zero; 3]; 3];
    for k in 0..3 {
        let (ex, ey) = (x[(k + 1) % 3] - x[k], y[(k + 1) % 3] - y[k]);
        let length2 = ex * ex + ey * ey;
        let some = splat::<T::Lanes>(POINT * half * half).less(length2.value());
        (edge_x[k], edge_y[k]) = (ex, ey);
        inverse[k] = T::choose(some, length2, T::constant(splat(1.0))).inverse().masked(some);
        longest = length2.value().max(longest);

        let (ex, ey) = (ex.value().only(solid), ey.value().only(solid));
        let per_length = inverse[k].value().sqrt();
        let (across_x, across_y) = (ey.neg() * per_length, ex * per_length);
        let start = (across_x * x[k].value() + across_y * y[k].value()).neg();
        (lines[0][k], lines[1][k], lines[2][k]) = (start, across_x, across_y);

        // ex (py - y) - ey (px - x) >= -radius |e|, solved for px. The bound is useless for a nearly horizontal edge, or for a face without
        // area.
        let flat = splat::<T::Lanes>(FLAT * FLAT) * ex * ex;
        let useful = flat.less(ey * ey);
        let tilt = (ex * Lanes::recip(pick(useful, ey, splat(1.0)))).only(useful);
        let reach = radius * (splat::<T::Lanes>(1.0) + tilt * tilt).sqrt();
        let bound = x[k].value() - tilt * y[k].value();
        let never = splat::<T::Lanes>(FAR_AWAY * half);
        let low = pick(ey.less(zero), bound - reach, never.neg());
        let high = pick(zero.less(ey), bound + reach, never);
        spans.tilt[k] = tilt.array();
        spans.low[k] = pick(useful, low, never.neg()).array();
        spans.high[k] = pick(useful, high, never).array();
    }
    let stout = (splat::<T::Lanes>(SLIVER) * longest).less(area);
    for k in 0..3 {
        <T::Lanes as Lanes>::to_rows(lines[k], &mut faces.lines[k]);
    }
    T::write_threes(x, &mut faces.x);
    T::write_threes(y, &mut faces.y);
    T::write_threes(edge_x, &mut faces.edge_x);
    T::write_threes(edge_y, &mut faces.edge_y);
    T::write_threes(inverse, &mut faces.inverse);
    faces.turned = T::Lanes::bits(turned);
    faces.slivers = !T::Lanes::bits(stout);
    faces.solid = T::Lanes::bits(solid);
    spans
}

impl<T: Real> Spans<T> {
    /// Columns from 0 to `width` that all three edges of a lane allow in the rows at `y`: first column and the one after the last.
    #[inline(always)]
    pub(crate) fn columns(&self, lane: usize, y: T::Lanes, width: T::Lanes) -> [T::Lanes; 2] {
        let lane = lane % LANES;
        let (mut low, mut high) = (splat::<T::Lanes>(0.0), width);
        for k in 0..3 {
            let shift = T::Lanes::splat(self.tilt[k][lane]) * y;
            low = (T::Lanes::splat(self.low[k][lane]) + shift).max(low);
            high = (T::Lanes::splat(self.high[k][lane]) + shift).min(high);
        }
        // The first centre at or after low, and the one after the last at or before high.
        let start = (low + splat(0.5 - MARGIN)).max(splat(0.0)).min(width);
        let end = (high + splat(0.5 + MARGIN)).min(width).max(splat(0.0));
        [start.rounded(), end.rounded()]
    }
}
