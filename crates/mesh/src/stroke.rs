//! Strokes, the components of the solids of the generators.

use crate::vectors::{difference, dot, norm};

/// A tapered stroke with round ends: from a point and radius to a point and radius.
pub(crate) type Stroke = ([f64; 3], f64, [f64; 3], f64);

/// Distance to a stroke whose radius changes linearly along it; negative inside.
pub(crate) fn distance(p: [f64; 3], &(from, from_radius, to, to_radius): &Stroke) -> f64 {
    let (along, offset) = (difference(to, from), difference(p, from));
    let t = (dot(offset, along) / dot(along, along)).clamp(0.0, 1.0);
    let away = [0, 1, 2].map(|k| offset[k] - t * along[k]);
    norm(away) - (from_radius + t * (to_radius - from_radius))
}

/// The smaller of two distances, with the crease between them smoothed over about `reach`.
pub(crate) fn smooth_min(a: f64, b: f64, reach: f64) -> f64 {
    let near = (reach - (a - b).abs()).max(0.0);
    a.min(b) - near * near / (4.0 * reach)
}

/// Rounds to five decimals, so that a file of the coordinate can be exact.
pub(crate) fn rounded(x: f64) -> f64 {
    (x * 1e5).round() / 1e5 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_counts_from_the_surface_of_the_stroke() {
        let stroke = ([0.0; 3], 0.2, [2.0, 0.0, 0.0], 0.4);
        for (p, expected) in
            [([1.0, 1.0, 0.0], 0.7), ([-1.0, 0.0, 0.0], 0.8), ([2.0, 0.0, 0.0], -0.4)]
        {
            assert!((distance(p, &stroke) - expected).abs() < 1e-12, "{p:?}");
        }
    }

    #[test]
    fn a_joint_fills_the_crease_alone() {
        assert_eq!(smooth_min(0.3, 0.1, 0.1), 0.1);
        assert!(smooth_min(0.1, 0.1, 0.1) < 0.1);
    }
}
