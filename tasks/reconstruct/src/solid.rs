//! Solids made of a few simple parts, for the shapes of the procedural set.

use softrast_mesh::vectors::{difference, dot, norm};

/// A simple solid, in world units.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Part {
    /// A box with round edges: its half extents include the rounding.
    Block { centre: [f64; 3], half: [f64; 3], rounding: f64 },
    /// A tapered stroke with round ends, thinned along each axis by a factor of at least 1.
    Stroke { from: [f64; 3], to: [f64; 3], radii: [f64; 2], thinned: [f64; 3] },
    /// A truncated cone around the y axis, from `low` to `high` along y, with a radius at either end.
    Cone { centre: [f64; 2], low: f64, high: f64, radii: [f64; 2] },
}

impl Part {
    /// A round stroke.
    pub(crate) fn stroke(from: [f64; 3], to: [f64; 3], radii: [f64; 2]) -> Self {
        Self::Stroke { from, to, radii, thinned: [1.0; 3] }
    }

    /// A box with practically sharp edges.
    pub(crate) fn block(centre: [f64; 3], half: [f64; 3]) -> Self {
        Self::Block { centre, half, rounding: 0.01 }
    }

    /// Centre and radius of a bounding ball of the part.
    pub(crate) fn ball(&self) -> ([f64; 3], f64) {
        match self {
            Self::Block { centre, half, .. } => (*centre, norm(*half)),
            Self::Stroke { from, to, radii, .. } => {
                let middle = [0, 1, 2].map(|k| f64::midpoint(from[k], to[k]));
                let half = norm(difference(*to, middle));
                (middle, half + radii[0].max(radii[1]))
            }
            Self::Cone { centre: [x, z], low, high, radii } => {
                let radius = radii[0].max(radii[1]).hypot((high - low) / 2.0);
                ([*x, f64::midpoint(*low, *high), *z], radius)
            }
        }
    }

    /// A lower bound of the distance from `p` to the part; negative inside.
    pub(crate) fn distance(&self, p: [f64; 3]) -> f64 {
        match self {
            Self::Block { centre, half, rounding } => {
                let beyond = [0, 1, 2].map(|k| (p[k] - centre[k]).abs() - (half[k] - rounding));
                outside(&beyond) - rounding
            }
            Self::Stroke { from, to, radii, thinned } => {
                // In a space stretched along the thin axes the part is round; distances there are
                // at least those here, and at most the largest factor times them.
                let p = [0, 1, 2].map(|k| p[k] * thinned[k]);
                let [from, to] = [from, to].map(|end| [0, 1, 2].map(|k| end[k] * thinned[k]));
                let along = difference(to, from);
                let offset = difference(p, from);
                let t = (dot(offset, along) / dot(along, along)).clamp(0.0, 1.0);
                let away = norm([0, 1, 2].map(|k| offset[k] - t * along[k]));
                let factor = thinned.iter().copied().fold(1.0, f64::max);
                // On a tapered stroke, the surface is nearer than perpendicular to its axis.
                let slope = (radii[1] - radii[0]) / norm(along);
                (away - radii[0] - t * (radii[1] - radii[0])) / (factor * slope.hypot(1.0))
            }
            Self::Cone { centre, low, high, radii } => {
                let ring = (p[0] - centre[0]).hypot(p[2] - centre[1]);
                let t = ((p[1] - low) / (high - low)).clamp(0.0, 1.0);
                let slope = (radii[1] - radii[0]) / (high - low);
                let side = (ring - radii[0] - t * (radii[1] - radii[0])) / slope.hypot(1.0);
                let end = (p[1] - f64::midpoint(*low, *high)).abs() - (high - low) / 2.0;
                outside(&[side, end])
            }
        }
    }
}

/// A shape as a union of parts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Solid {
    pub(crate) parts: Vec<Part>,
    /// Red, green and blue of its surface, 0 to 1.
    pub(crate) colour: [f64; 3],
}

impl Solid {
    /// A lower bound of the distance from `p` to the nearest part, up to rounding; negative inside.
    pub(crate) fn distance(&self, p: [f64; 3]) -> f64 {
        self.parts.iter().map(|part| part.distance(p)).fold(f64::INFINITY, f64::min)
    }
}

/// Distance of a point from a box, given its offset beyond each side; negative inside.
fn outside<const N: usize>(beyond: &[f64; N]) -> f64 {
    let inside = beyond.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(0.0);
    let square: f64 = beyond.iter().map(|x| x.max(0.0).powi(2)).sum();
    square.sqrt() + inside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(part: &Part, p: [f64; 3]) -> f64 {
        part.distance(p)
    }

    #[test]
    fn distances_are_those_worked_by_hand() {
        let block = Part::Block { centre: [1.0, 0.0, 0.0], half: [0.5, 0.2, 0.2], rounding: 0.1 };
        let stroke = Part::stroke([0.0; 3], [2.0, 0.0, 0.0], [0.2, 0.4]);
        let can = Part::Cone { centre: [0.0; 2], low: -1.0, high: 1.0, radii: [0.5; 2] };
        let close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}");
        close(at(&block, [2.0, 0.0, 0.0]), 0.5);
        close(at(&block, [1.0, 0.0, 0.0]), -0.2);
        close(at(&stroke, [1.0, 1.0, 0.0]), 0.7 / 1.01_f64.sqrt());
        close(at(&stroke, [2.0, 0.0, 0.0]), -0.4 / 1.01_f64.sqrt());
        close(at(&can, [0.5 + 3.0, 5.0, 0.0]), 5.0);
        close(at(&can, [0.0; 3]), -0.5);
    }

    #[test]
    fn a_thinned_stroke_is_thin_along_its_axis_and_never_farther_than_said() {
        let wing = Part::Stroke {
            from: [0.0; 3],
            to: [1.0, 0.0, 0.0],
            radii: [0.3, 0.3],
            thinned: [1.0, 3.0, 1.0],
        };
        assert!(at(&wing, [0.5, 0.099, 0.0]) < 0.0 && at(&wing, [0.5, 0.101, 0.0]) > 0.0);
        assert!(at(&wing, [0.5, 0.0, 0.299]) < 0.0 && at(&wing, [0.5, 0.0, 0.301]) > 0.0);
        assert!(at(&wing, [0.5, 0.4, 0.0]) <= 0.3 + 1e-12);
    }
}
