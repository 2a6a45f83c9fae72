//! One projected triangle: its edges, and the pixels of a row that its support can reach.

use super::real::{Float, Real};

/// Edge vectors shorter than this (NDC², squared length) count as a point.
const POINT: f64 = 1e-30;
/// Projected coordinates beyond this (NDC) are not drawn: a table reaches no farther.
const FAR_AWAY: f64 = 1e6;

/// Faces that are prepared together.
pub(crate) const BLOCK: usize = 8;

type Lanes<N> = [N; BLOCK];

/// Projected triangles prepared for distances, one a lane; corner k starts edge k.
///
/// Meshes have faces of a few pixels, so that what a face costs before its first pixel counts. Every
/// loop runs over the faces of a block, which the compiler turns into straight vector code.
pub(crate) struct Faces<T: Real> {
    x: [Lanes<T>; 3],
    y: [Lanes<T>; 3],
    edge_x: [Lanes<T>; 3],
    edge_y: [Lanes<T>; 3],
    inverse: [Lanes<T>; 3],
    /// Sign of the area; 0 for a triangle without area.
    orientation: Lanes<T::Float>,
    side_x: [Lanes<T::Float>; 3],
    side_y: [Lanes<T::Float>; 3],
    spans: Spans<Lanes<T::Float>>,
}

/// One of them.
#[derive(Clone, Copy)]
pub(crate) struct Face<T: Real> {
    pub(crate) x: [T; 3],
    pub(crate) y: [T; 3],
    pub(crate) edge_x: [T; 3],
    pub(crate) edge_y: [T; 3],
    /// One over the squared length of each edge; 0 for an edge that is a point.
    pub(crate) inverse: [T; 3],
    /// The edges as they run counterclockwise; 0 for a triangle without area.
    pub(crate) side_x: [T::Float; 3],
    pub(crate) side_y: [T::Float; 3],
    /// What the least of the three edge functions may be at most: -1 for a triangle without area,
    /// which has no inside.
    pub(crate) most: T::Float,
}

/// The three edges of a face as limits on x in a given row.
#[derive(Clone, Copy)]
pub(crate) struct Spans<F> {
    // Edge k asks for x >= low[k] + tilt[k] * y and x <= high[k] + tilt[k] * y; one of the two is
    // out of reach.
    low: [F; 3],
    high: [F; 3],
    tilt: [F; 3],
}

impl<T: Real> Faces<T> {
    /// Prepares triangles with the given corners (NDC) for pixels no farther than `radius` outside.
    #[inline(always)]
    pub(crate) fn new(x: [Lanes<T>; 3], y: [Lanes<T>; 3], radius: T::Float) -> Self {
        let (zero, one) = (T::Float::ZERO, T::Float::ONE);
        let nothing = [[T::ZERO; BLOCK]; 3];
        let (mut edge_x, mut edge_y, mut inverse) = (nothing, nothing, nothing);
        for k in 0..3 {
            for i in 0..BLOCK {
                let (ex, ey) = (x[(k + 1) % 3][i] - x[k][i], y[(k + 1) % 3][i] - y[k][i]);
                let length2 = ex * ex + ey * ey;
                let some = length2.value() > T::Float::from_f64(POINT);
                let recip = if some { length2 } else { T::ONE }.recip();
                inverse[k][i] = if some { recip } else { T::ZERO };
                (edge_x[k][i], edge_y[k][i]) = (ex, ey);
            }
        }
        let mut orientation = [zero; BLOCK];
        for i in 0..BLOCK {
            let unit = |some: bool| if some { one } else { zero };
            let area = edge_x[0][i].value() * edge_y[1][i].value()
                - edge_y[0][i].value() * edge_x[1][i].value();
            orientation[i] = unit(area > zero) - unit(area < zero);
        }
        let mut faces = Self {
            x,
            y,
            edge_x,
            edge_y,
            inverse,
            orientation,
            side_x: [[zero; BLOCK]; 3],
            side_y: [[zero; BLOCK]; 3],
            spans: Spans {
                low: [[zero; BLOCK]; 3],
                high: [[zero; BLOCK]; 3],
                tilt: [[zero; BLOCK]; 3],
            },
        };
        faces.limit(radius);
        faces
    }

    /// Finds the limits for pixels no farther than `radius` outside the faces.
    #[inline(always)]
    fn limit(&mut self, radius: T::Float) {
        let (zero, one) = (T::Float::ZERO, T::Float::ONE);
        let never = T::Float::from_f64(FAR_AWAY);
        // The bound is of no use for an edge that is all but horizontal, or for a face without area.
        let flat = T::Float::from_f64(1e-3);
        for k in 0..3 {
            for i in 0..BLOCK {
                let ex = self.edge_x[k][i].value() * self.orientation[i];
                let ey = self.edge_y[k][i].value() * self.orientation[i];
                (self.side_x[k][i], self.side_y[k][i]) = (ex, ey);
                // ex (py - y) - ey (px - x) >= -radius |e|, solved for px.
                let useless = ey * ey <= flat * flat * ex * ex;
                let tilt = ex * if useless { one } else { ey }.recip();
                let reach = radius * (one + tilt * tilt).sqrt();
                let bound = self.x[k][i].value() - tilt * self.y[k][i].value();
                self.spans.tilt[k][i] = if useless { zero } else { tilt };
                self.spans.low[k][i] = if (ey < zero) & !useless { bound - reach } else { -never };
                self.spans.high[k][i] = if (ey > zero) & !useless { bound + reach } else { never };
            }
        }
    }

    /// The face of a lane.
    #[inline(always)]
    pub(crate) fn face(&self, lane: usize) -> Face<T> {
        let flat = self.orientation[lane] == T::Float::ZERO;
        Face {
            x: of_lane(&self.x, lane),
            y: of_lane(&self.y, lane),
            edge_x: of_lane(&self.edge_x, lane),
            edge_y: of_lane(&self.edge_y, lane),
            inverse: of_lane(&self.inverse, lane),
            side_x: of_lane(&self.side_x, lane),
            side_y: of_lane(&self.side_y, lane),
            most: if flat { -T::Float::ONE } else { T::Float::ONE },
        }
    }

    /// The limits of a lane.
    #[inline(always)]
    pub(crate) fn spans(&self, lane: usize) -> Spans<T::Float> {
        let Spans { low, high, tilt } = &self.spans;
        Spans { low: of_lane(low, lane), high: of_lane(high, lane), tilt: of_lane(tilt, lane) }
    }
}

/// What three edges or corners have in a lane. Written out: `map` on an array is a call.
#[inline(always)]
fn of_lane<N: Copy>([a, b, c]: &[Lanes<N>; 3], lane: usize) -> [N; 3] {
    [a[lane], b[lane], c[lane]]
}

/// Where a vertex lies in a `size` px image: column and row, whole numbers at the centres of
/// pixels, the top row first. Infinite for a vertex whose faces are not drawn: one nearer than
/// `near`, behind the camera, not finite, or farther than 1e6 NDC away.
#[inline(always)]
pub(crate) fn in_pixels<F: Float>([x, y, z]: [F; 3], near: F, size: usize) -> [F; 2] {
    let far = F::from_f64(FAR_AWAY);
    let half = F::from_f64(0.5 * size as f64);
    let middle = F::from_f64(0.5 * (size as f64 - 1.0));
    // Written so that NaN is not drawn either.
    let drawn = (z >= near) & (x <= far) & (x >= -far) & (y <= far) & (y >= -far);
    let place = |at: F| if drawn { at * half + middle } else { F::from_f64(f64::INFINITY) };
    [place(x), place(-y)]
}

/// Pixels that a face may reach: rows and columns as half-open ranges, top row first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reach {
    pub(crate) top: u32,
    pub(crate) bottom: u32,
    pub(crate) left: u32,
    pub(crate) right: u32,
}

impl Reach {
    /// No pixel.
    pub(crate) const NOTHING: Self = Self { top: 0, bottom: 0, left: 0, right: 0 };

    /// Pixels of a `size` px image no farther than `radius` pixels from the bounding box of three
    /// corners, given as [`in_pixels`] does; `None` where one of them is not drawn.
    #[inline(always)]
    pub(crate) fn around<F: Float>(corners: [[F; 2]; 3], radius: F, size: usize) -> Option<Self> {
        let size = F::from_f64(size as f64);
        // More than places of pixels are rounded by.
        let grown = radius + size * F::from_f64(1e-6) + F::from_f64(0.5);
        let least = |a: F, b: F| if a < b { a } else { b };
        let largest = |a: F, b: F| if a > b { a } else { b };
        let limit = |at: F| least(largest(at, F::ZERO), size).nearest() as u32;
        let highest =
            |axis: usize| largest(largest(corners[0][axis], corners[1][axis]), corners[2][axis]);
        let range = |axis: usize| {
            let low = least(least(corners[0][axis], corners[1][axis]), corners[2][axis]);
            (limit(low - grown + F::ONE), limit(highest(axis) + grown))
        };
        if highest(0) == F::from_f64(f64::INFINITY) {
            return None;
        }
        let ((left, right), (top, bottom)) = (range(0), range(1));
        let some = left < right && top < bottom;
        Some(if some { Self { top, bottom, left, right } } else { Self::NOTHING })
    }
}

/// Rows that [`Spans::columns`] handles at once.
pub(crate) const SPANS: usize = 8;

impl<F: Float> Spans<F> {
    /// Columns that all three edges allow in the rows at heights `y`, within the columns of
    /// `reach`: first column and the one after the last.
    #[inline(always)]
    pub(crate) fn columns(
        &self,
        y: &[F; SPANS],
        reach: Reach,
        size: usize,
    ) -> ([i32; SPANS], [i32; SPANS]) {
        let half = F::from_f64(0.5 * size as f64);
        let middle = F::from_f64(0.5 * (size as f64 - 1.0));
        // A hundredth of a pixel makes up for rounding.
        let margin = F::from_f64(0.01);
        let point_five = F::from_f64(0.5);
        let limits = [F::from_f64(f64::from(reach.left)), F::from_f64(f64::from(reach.right))];
        let mut starts = [0; SPANS];
        let mut ends = [0; SPANS];
        for i in 0..SPANS {
            let (mut low, mut high) = (-F::ONE - F::ONE, F::ONE + F::ONE);
            for k in 0..3 {
                let shift = self.tilt[k] * y[i];
                let (l, h) = (self.low[k] + shift, self.high[k] + shift);
                low = if l > low { l } else { low };
                high = if h < high { h } else { high };
            }
            // The first centre at or after low, and the one after the last at or before high.
            let low = low * half + middle - margin + point_five;
            let high = high * half + middle + margin + point_five;
            let low = if low > limits[0] { low } else { limits[0] };
            let high = if high < limits[1] { high } else { limits[1] };
            starts[i] = if low < limits[1] { low } else { limits[1] }.nearest();
            ends[i] = if high > F::ZERO { high } else { F::ZERO }.nearest();
        }
        (starts, ends)
    }
}

/// Calls `fill(row, start, end)` for the pixels whose centre a face over `vertices`
/// `[3, vertices]` covers (edges included).
pub(crate) fn inside_spans<F: Float>(
    vertices: &[F],
    face: &[u32; 3],
    near: f64,
    size: usize,
    mut fill: impl FnMut(usize, usize, usize),
) {
    // Exact decisions: the edge functions of the corners as given, in f64.
    let count = vertices.len() / 3;
    let corners = face.map(|v| [0, 1, 2].map(|axis| vertices[axis * count + v as usize].to_f64()));
    let Some(reach) = Reach::around(corners.map(|at| in_pixels(at, near, size)), 0.0, size) else {
        return;
    };
    let edges = [0, 1, 2].map(|k| {
        let ([x, y, _], [to_x, to_y, _]) = (corners[k], corners[(k + 1) % 3]);
        [x, y, to_x - x, to_y - y]
    });
    let area = edges[0][2] * edges[1][3] - edges[0][3] * edges[1][2];
    if area == 0.0 {
        return;
    }
    let (left, right) = (reach.left as usize, reach.right as usize);
    for row in reach.top as usize..reach.bottom as usize {
        let py = pixel_centre(size - 1 - row, size);
        let covers = |column: &usize| {
            let px = pixel_centre(*column, size);
            let side = |&[x, y, ex, ey]: &[f64; 4]| ex * (py - y) - ey * (px - x);
            edges.iter().all(|edge| area.signum() * side(edge) >= 0.0)
        };
        let Some(start) = (left..right).find(covers) else { continue };
        let end = (start..right).find(|column| !covers(column)).unwrap_or(right);
        fill(row, start, end);
    }
}

/// Centre of pixel `index` along an axis in NDC; rows count from the bottom here.
#[inline]
pub(crate) fn pixel_centre(index: usize, size: usize) -> f64 {
    (2.0 * index as f64 + 1.0 - size as f64) / size as f64
}
