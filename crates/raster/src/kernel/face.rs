//! One projected triangle: its edges, and the pixels of a row that its support can reach.

use super::real::{Float, Real};

/// Edge vectors shorter than this (NDC², squared length) count as a point.
const POINT: f64 = 1e-30;
/// Projected coordinates beyond this (NDC) are not drawn: a table reaches no farther.
const FAR_AWAY: f64 = 1e6;

/// Numbers of the edges, and one to fill a vector.
const VECTOR: usize = 4;

/// The numbers of three edges with the last one twice.
#[inline(always)]
fn filled<N: Copy>([a, b, c]: [N; 3]) -> [N; VECTOR] {
    [a, b, c, c]
}

#[inline(always)]
fn three<N>([a, b, c, _]: [N; VECTOR]) -> [N; 3] {
    [a, b, c]
}

/// The numbers of three edges without their derivatives. Written out: `map` on an array is a call.
#[inline(always)]
fn values<T: Real>([a, b, c]: [T; 3]) -> [T::Float; VECTOR] {
    filled([a.value(), b.value(), c.value()])
}

/// A projected triangle prepared for distances; corner k starts edge k.
#[derive(Clone, Copy)]
pub(crate) struct Face<T: Real> {
    pub(crate) x: [T; 3],
    pub(crate) y: [T; 3],
    pub(crate) edge_x: [T; 3],
    pub(crate) edge_y: [T; 3],
    /// One over the squared length of each edge; 0 for an edge that is a point.
    pub(crate) inverse: [T; 3],
    /// Sign of the area; 0 for a triangle without area.
    pub(crate) orientation: T::Float,
    /// What `orientation * edge function` must reach inside: 0, or 1 to say never.
    pub(crate) threshold: T::Float,
}

impl<T: Real> Face<T> {
    /// Prepares the triangle with the given corners (NDC).
    #[inline(always)]
    pub(crate) fn new(x: [T; 3], y: [T; 3]) -> Self {
        let (zero, one) = (T::Float::ZERO, T::Float::ONE);
        // No branch and a fourth lane: one vector holds what is the same for all edges.
        let from = [filled(x), filled(y)];
        let to = [[x[1], x[2], x[0], x[0]], [y[1], y[2], y[0], y[0]]];
        let mut edges = [[T::ZERO; VECTOR]; 2];
        let mut inverses = [T::ZERO; VECTOR];
        for k in 0..VECTOR {
            let (ex, ey) = (to[0][k] - from[0][k], to[1][k] - from[1][k]);
            let length2 = ex * ex + ey * ey;
            let some = length2.value() > T::Float::from_f64(POINT);
            let inverse = if some { length2 } else { T::ONE }.recip();
            inverses[k] = if some { inverse } else { T::ZERO };
            (edges[0][k], edges[1][k]) = (ex, ey);
        }
        let [edge_x, edge_y, inverse] = [three(edges[0]), three(edges[1]), three(inverses)];
        let area = edge_x[0].value() * edge_y[1].value() - edge_y[0].value() * edge_x[1].value();
        let unit = |some: bool| if some { one } else { zero };
        let orientation = unit(area > zero) - unit(area < zero);
        let threshold = if orientation == zero { one } else { zero };
        Self { x, y, edge_x, edge_y, inverse, orientation, threshold }
    }
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

/// The three edges of a face as limits on x in a given row.
pub(crate) struct Spans<F> {
    // Edge k asks for x >= low[k] + tilt[k] * y and x <= high[k] + tilt[k] * y; one of the two is
    // out of reach.
    low: [F; VECTOR],
    high: [F; VECTOR],
    tilt: [F; VECTOR],
}

/// Rows that [`Spans::columns`] handles at once.
pub(crate) const SPANS: usize = 8;

impl<F: Float> Spans<F> {
    /// Limits for pixels no farther than `radius` outside the face.
    #[inline(always)]
    pub(crate) fn new<T: Real<Float = F>>(face: &Face<T>, radius: F) -> Self {
        let never = F::from_f64(FAR_AWAY);
        // The bound is of no use for an edge that is all but horizontal, or for a face without area.
        let flat = F::from_f64(1e-3);
        let mut spans = Self { low: [F::ZERO; 4], high: [F::ZERO; 4], tilt: [F::ZERO; 4] };
        let (edge_x, edge_y) = (values(face.edge_x), values(face.edge_y));
        let (from_x, from_y) = (values(face.x), values(face.y));
        for k in 0..VECTOR {
            let (ex, ey) = (edge_x[k] * face.orientation, edge_y[k] * face.orientation);
            // ex (py - y) - ey (px - x) >= -radius |e|, solved for px.
            let useless = ey * ey <= flat * flat * ex * ex;
            let tilt = ex * if useless { F::ONE } else { ey }.recip();
            let reach = radius * (F::ONE + tilt * tilt).sqrt();
            let bound = from_x[k] - tilt * from_y[k];
            spans.tilt[k] = if useless { F::ZERO } else { tilt };
            spans.low[k] = if (ey < F::ZERO) & !useless { bound - reach } else { -never };
            spans.high[k] = if (ey > F::ZERO) & !useless { bound + reach } else { never };
        }
        spans
    }

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
    let face = Face::<f64>::new(corners.map(|at| at[0]), corners.map(|at| at[1]));
    if face.orientation == 0.0 {
        return;
    }
    let (left, right) = (reach.left as usize, reach.right as usize);
    for row in reach.top as usize..reach.bottom as usize {
        let y = pixel_centre(size - 1 - row, size);
        let covers = |column: &usize| {
            let x = pixel_centre(*column, size);
            (0..3).all(|k| {
                let (wx, wy) = (x - face.x[k], y - face.y[k]);
                face.orientation * (face.edge_x[k] * wy - face.edge_y[k] * wx) >= 0.0
            })
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
