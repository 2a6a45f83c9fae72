//! Positions of faces in the image, computed per face on plain floats.

use std::ops::Range;

use super::float::Float;
use crate::ImageSize;

/// Projected coordinates beyond this (NDC) are not drawn; it also bounds the support of a table.
pub const FAR_AWAY: f64 = 1e6;

/// Position of a vertex in the image: column and row, whole numbers at pixel centres, the top row first. Infinite if its faces are not
/// drawn: for a vertex nearer than `near`, behind the camera, not finite, or farther than 1e6 NDC away.
#[inline(always)]
pub(crate) fn in_pixels<F: Float>([x, y, z]: [F; 3], near: F, size: ImageSize) -> [F; 2] {
    let far = F::from_f64(FAR_AWAY);
    let half = F::from_f64(0.5 * size.shorter() as f64);
    let middle = |side: usize| F::from_f64(0.5 * (side as f64 - 1.0));
    // Written so that NaN is not drawn either.
    let drawn = (z >= near) & (x <= far) & (x >= -far) & (y <= far) & (y >= -far);
    let place = |at: F, side: usize| match drawn {
        true => at * half + middle(side),
        false => F::from_f64(f64::INFINITY),
    };
    [place(x, size.width), place(-y, size.height)]
}

/// Whether corners given in NDC, y up, are in clockwise order.
///
/// ```
/// use softrast_kernel::is_seen_clockwise;
///
/// assert!(is_seen_clockwise([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]));
/// assert!(!is_seen_clockwise([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]));
/// ```
pub fn is_seen_clockwise<F: Float>(corners: [[F; 2]; 3]) -> bool {
    let [[ax, ay], [bx, by], [cx, cy]] = corners.map(|corner| corner.map(F::to_f64));
    (bx - ax) * (cy - ay) < (by - ay) * (cx - ax)
}

/// Distance from the bounding box of a face up to which it reaches pixel centres along an axis of `side` pixels, with a margin above the
/// rounding of positions.
#[inline(always)]
pub(crate) fn grown<F: Float>(radius: F, side: usize) -> F {
    radius + F::from_f64(side as f64 * 1e-6) + F::from_f64(0.5)
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

    /// Pixels of an image no farther than `radius` pixels from the bounding box of three corners, given as by [`in_pixels`]; `None` if a
    /// corner is not drawn.
    #[inline(always)]
    pub(crate) fn around<F: Float>(
        corners: [[F; 2]; 3],
        radius: F,
        size: ImageSize,
    ) -> Option<Self> {
        let least = |a: F, b: F| if a < b { a } else { b };
        let largest = |a: F, b: F| if a > b { a } else { b };
        let limit = |at: F, side: usize| {
            least(largest(at, F::ZERO), F::from_f64(side as f64)).nearest() as u32
        };
        let highest =
            |axis: usize| largest(largest(corners[0][axis], corners[1][axis]), corners[2][axis]);
        let range = |axis: usize, side: usize| {
            let low = least(least(corners[0][axis], corners[1][axis]), corners[2][axis]);
            let grown = grown(radius, side);
            (limit(low - grown + F::ONE, side), limit(highest(axis) + grown, side))
        };
        if highest(0) == F::from_f64(f64::INFINITY) {
            return None;
        }
        let ((left, right), (top, bottom)) = (range(0, size.width), range(1, size.height));
        let some = left < right && top < bottom;
        Some(if some { Self { top, bottom, left, right } } else { Self::NOTHING })
    }
}

/// Rows of a band that a face may reach.
#[inline(always)]
pub(crate) fn within(band: Range<usize>, reach: Reach) -> Range<usize> {
    band.start.max(reach.top as usize)..band.end.min(reach.bottom as usize)
}

/// Calls `fill(row, start, end)` for the pixels whose centre a face over `vertices`
/// `[3, vertices]` covers (edges included).
///
/// ```
/// use softrast_kernel::inside_spans;
///
/// // The upper left half of 4 x 4 pixels: x, y and depth of three vertices.
/// let vertices = [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 2.0, 2.0, 2.0];
/// let mut spans = Vec::new();
/// inside_spans(&vertices, &[0, 1, 2], 0.01, 4.into(), |row, start, end| spans.push((row, start, end)));
/// assert_eq!(spans, [(0, 0, 4), (1, 0, 3), (2, 0, 2), (3, 0, 1)]);
/// ```
pub fn inside_spans<F: Float>(
    vertices: &[F],
    face: &[u32; 3],
    near: f64,
    size: ImageSize,
    mut fill: impl FnMut(usize, usize, usize),
) {
    // Exact: the edge functions of the original corners, in f64.
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
        let py = size.row_centre(row);
        let covers = |column: &usize| {
            let px = size.column_centre(*column);
            let side = |&[x, y, ex, ey]: &[f64; 4]| ex * (py - y) - ey * (px - x);
            edges.iter().all(|edge| area.signum() * side(edge) >= 0.0)
        };
        let Some(start) = (left..right).find(covers) else { continue };
        let end = (start..right).find(|column| !covers(column)).unwrap_or(right);
        fill(row, start, end);
    }
}
