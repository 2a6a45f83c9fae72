//! Where faces lie in the image: decided face by face, on plain floats.

use super::float::Float;

/// Projected coordinates beyond this (NDC) are not drawn: a table reaches no farther.
pub(crate) const FAR_AWAY: f64 = 1e6;

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

/// How far from its bounding box a face reaches the centres of pixels, with more than places of pixels are rounded by.
#[inline(always)]
pub(crate) fn grown<F: Float>(radius: F, size: usize) -> F {
    radius + F::from_f64(size as f64 * 1e-6) + F::from_f64(0.5)
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
        let grown = grown(radius, size);
        let size = F::from_f64(size as f64);
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
