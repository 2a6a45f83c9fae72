use serde::{Deserialize, Serialize};
use softrast_raster::low_level::Rasterizer;
use softrast_softness::{EdgeSoftness, Softness};

use crate::{Resolution, ScheduledSoftness};

/// A way to solve any problem: a softness, how its scale moves, and how finely it is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Method<S = EdgeSoftness> {
    /// What it is called in tables.
    pub name: String,
    /// The softness of edges, with its schedule, surrogate and learning rate.
    pub softness: ScheduledSoftness<S>,
    /// How many pixels the image has that is optimised on.
    #[serde(default)]
    pub resolution: Resolution,
    /// Largest error of a pixel by leaving out faces that are far from it; none for the usual one.
    #[serde(default)]
    pub tolerance: Option<f64>,
}

/// Largest error of a pixel while learning by derivatives, unless another is asked for.
///
/// The second derivative of a table of cubics is its least exact one, so that meta-gradients are off by up to a tenth here, and by
/// their own size at 1e-2 (`both_ways_to_draw_have_the_same_meta_gradient`).
const LEARNING_TOLERANCE: f64 = 1e-3;

impl Method {
    /// The largest error of a pixel unless another is asked for, where the scale stays or `moves`.
    ///
    /// A scale that stays is narrow, and what reaches the pixels far from an edge is a gradient that nobody sees in the image but that
    /// an optimiser follows. One that moves is wide first, when its near pixels tell as much, and is costly then.
    pub const fn usual_tolerance(moves: bool) -> f64 {
        if moves { 1e-2 } else { Rasterizer::TOLERANCE }
    }
}

impl<S: Softness> Method<S> {
    /// A method that draws as usual.
    pub fn new(name: &str, softness: ScheduledSoftness<S>) -> Self {
        Self { name: name.to_owned(), softness, resolution: Resolution::Full, tolerance: None }
    }

    /// The largest error of a pixel.
    pub fn tolerance(&self) -> f64 {
        self.tolerance.unwrap_or(Method::usual_tolerance(!self.softness.is_constant()))
    }

    /// The same while the softness is learned: unless asked for, at most 1e-3 where that `differentiates` runs.
    pub fn learning_tolerance(&self, differentiates: bool) -> f64 {
        let usual = self.tolerance();
        let most = if differentiates { usual.min(LEARNING_TOLERANCE) } else { usual };
        self.tolerance.unwrap_or(most)
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
        assert_eq!((moving.tolerance(), moving.learning_tolerance(false)), (1e-2, 1e-2));
        assert_eq!(moving.learning_tolerance(true), LEARNING_TOLERANCE);
        let still = Method::new("gauss", ScheduledSoftness::constant(softness, 0.1));
        assert_eq!([still.tolerance(), still.learning_tolerance(true)], [Rasterizer::TOLERANCE; 2]);
        let asked = Method { tolerance: Some(0.05), ..moving };
        assert_eq!([asked.tolerance(), asked.learning_tolerance(true)], [0.05; 2]);
    }
}
