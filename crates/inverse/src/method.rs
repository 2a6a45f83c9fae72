use serde::{Deserialize, Serialize};
use softrast_raster::low_level::Rasterizer;
use softrast_softness::{EdgeSoftness, Softness};

use crate::{Resolution, ScheduledSoftness};

/// A method to solve any problem: a softness, the schedule of its scale, and the resolution it is drawn at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Method<S = EdgeSoftness> {
    /// Name in tables.
    pub name: String,
    /// The softness of edges, with its schedule, surrogate and learning rate.
    pub softness: ScheduledSoftness<S>,
    /// Resolution of the image that is optimised.
    #[serde(default)]
    pub resolution: Resolution,
    /// Largest error of a pixel, in coverage, from culling and interpolation; by default [`usual_tolerance`](Method::usual_tolerance).
    #[serde(default)]
    pub tolerance: Option<f64>,
}

/// Default of the largest error of a pixel while learning by derivatives.
///
/// The second derivative of a table of cubics is its least accurate one: meta-gradients are off by up to a tenth at
/// this tolerance, and by their own size at 1e-2 (`both_ways_to_draw_have_the_same_meta_gradient`).
const LEARNING_TOLERANCE: f64 = 1e-3;

impl Method {
    /// Default of the largest error of a pixel, for a fixed scale or one that `moves`.
    ///
    /// A fixed scale is narrow. Its gradient far from an edge is invisible in the image, but an optimiser follows it. A
    /// moving scale is wide at first: near pixels then give enough of the gradient, and drawing is costly.
    pub const fn usual_tolerance(moves: bool) -> f64 {
        if moves { 1e-2 } else { Rasterizer::TOLERANCE }
    }
}

impl<S: Softness> Method<S> {
    /// A method with the default resolution and tolerance.
    pub fn new(name: &str, softness: ScheduledSoftness<S>) -> Self {
        Self { name: name.to_owned(), softness, resolution: Resolution::Full, tolerance: None }
    }

    /// The largest error of a pixel.
    pub fn tolerance(&self) -> f64 {
        self.tolerance.unwrap_or(Method::usual_tolerance(!self.softness.is_constant()))
    }

    /// The largest error of a pixel while the softness is learned by differentiating runs: by default at most 1e-3.
    pub fn learning_tolerance(&self) -> f64 {
        self.tolerance.unwrap_or(self.tolerance().min(LEARNING_TOLERANCE))
    }
}

#[cfg(test)]
mod tests {
    use softrast_softness::Family;

    use super::*;

    #[test]
    fn a_scale_that_moves_is_drawn_less_exactly_unless_derivatives_are_taken() {
        let softness = EdgeSoftness::new(Family::Gauss);
        let moving = Method::new("gauss", ScheduledSoftness::decay(softness, 0.1, 0.001));
        assert_eq!([moving.tolerance(), moving.learning_tolerance()], [1e-2, LEARNING_TOLERANCE]);
        let still = Method::new("gauss", ScheduledSoftness::constant(softness, 0.1));
        assert_eq!([still.tolerance(), still.learning_tolerance()], [Rasterizer::TOLERANCE; 2]);
        let asked = Method { tolerance: Some(0.05), ..moving };
        assert_eq!([asked.tolerance(), asked.learning_tolerance()], [0.05; 2]);
    }
}
