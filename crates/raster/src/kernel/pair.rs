//! The arithmetic of one pixel and one face, generic over the number.

use super::{face::Face, real::Real};

/// Closest point of a triangle's boundary to a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Closest<T: Real> {
    /// Squared distance to it, NDC².
    pub(crate) distance2: T,
    /// From it to the pixel.
    pub(crate) dx: T,
    pub(crate) dy: T,
    /// Its barycentric weights.
    pub(crate) weights: [T; 3],
    /// At least 0 where the pixel lies in the triangle, edges included.
    pub(crate) inside: T::Float,
}

/// Closest boundary point, by projection onto each edge. No inverted matrix, no square root, no
/// division: slivers, points and pixels on an edge all give finite numbers.
#[inline(always)]
pub(crate) fn closest<T: Real>(face: &Face<T>, px: T::Float, py: T::Float) -> Closest<T> {
    let (zero, one) = (T::Float::ZERO, T::Float::ONE);
    let mut best = [T::ZERO; 3];
    let mut along = T::ZERO;
    let mut from = [zero; 3];
    let mut inside = face.most;
    for k in 0..3 {
        let wx = T::constant(px) - face.x[k];
        let wy = T::constant(py) - face.y[k];
        let t = (wx * face.edge_x[k] + wy * face.edge_y[k]) * face.inverse[k];
        let t = if t.value() > zero { t } else { T::ZERO };
        let t = if t.value() < one { t } else { T::ONE };
        let dx = wx - t * face.edge_x[k];
        let dy = wy - t * face.edge_y[k];
        let distance2 = dx * dx + dy * dy;
        let side = face.side_x[k] * wy.value() - face.side_y[k] * wx.value();
        inside = if side < inside { side } else { inside };
        let nearer = k == 0 || distance2.value() < best[0].value();
        best = [
            if nearer { distance2 } else { best[0] },
            if nearer { dx } else { best[1] },
            if nearer { dy } else { best[2] },
        ];
        along = if nearer { t } else { along };
        for (j, start) in from.iter_mut().enumerate() {
            *start = if nearer { if j == k { one } else { zero } } else { *start };
        }
    }
    // Corner k starts edge k and ends edge k - 1.
    let rest = T::ONE - along;
    let mut weights = [T::ZERO; 3];
    for k in 0..3 {
        weights[k] = rest.scale(from[k]) + along.scale(from[(k + 2) % 3]);
    }
    let [distance2, dx, dy] = best;
    Closest { distance2, dx, dy, weights, inside }
}
