use burn::tensor::{Tensor, backend::Backend};
use serde::{Deserialize, Serialize};

use crate::{EdgeSoftness, Family};

/// How wide a softness is in the course of a run: at part t of it, s is seen at `d / scale(t)`.
///
/// `scale(t) = floor + exp(l(t))`, where `l` joins the knots by straight lines. So the scale stays
/// above the floor, which is given in pixels because that is what an image can resolve, and its
/// gradient never vanishes, as it would under a hard limit.
///
/// Not in the paper, whose softness is the same at every step. Source: META 3, A and C.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScalePath {
    /// Logarithms of the scale above the floor at evenly spaced times, the first at the first step
    /// and the last at the last; in NDC, or NDC² if the softness is squared.
    pub knots: Vec<f64>,
    /// What the scale stays above, in pixels.
    pub floor_px: f64,
}

/// A path has at most so many knots.
pub(crate) const MOST_KNOTS: usize = 16;

impl ScalePath {
    /// The floor in the unit of the scale of `softness`, on images of `size` × `size` pixels.
    pub fn floor(&self, softness: EdgeSoftness, size: usize) -> f64 {
        let width = self.floor_px * 2.0 / size as f64;
        if softness.squared { width * width } else { width }
    }

    /// The scale `[1]` at `part` of a run, 0 to 1, for these `knots` `[K]` and `floor`.
    ///
    /// # Panics
    ///
    /// If there is no knot, or `part` is not in [0, 1].
    pub fn scale<B: Backend>(knots: &Tensor<B, 1>, floor: f64, part: f64) -> Tensor<B, 1> {
        assert!((0.0..=1.0).contains(&part), "part {part} of a run is not in [0, 1]");
        let [count] = knots.dims();
        let place = part * (count - 1) as f64;
        let before = (place as usize).min(count.saturating_sub(2));
        let share = place - before as f64;
        let low = knots.clone().narrow(0, before, 1);
        let high = knots.clone().narrow(0, (before + 1).min(count - 1), 1);
        (low * (1.0 - share) + high * share).exp() + floor
    }
}

impl EdgeSoftness {
    /// Parameters of `s(x / scale)`, where `phi` are those of s and `scale` is `[1]`.
    pub fn widened<B: Backend>(&self, phi: Tensor<B, 1>, scale: Tensor<B, 1>) -> Tensor<B, 1> {
        let [count] = phi.dims();
        // The network has no scale of its own; its first layer multiplies the distance.
        let (of_scale, first) = match self.family {
            Family::Mlp => {
                (crate::mlp::WIDTH, phi.clone().narrow(0, 0, crate::mlp::WIDTH) * scale.recip())
            }
            _ => (1, phi.clone().narrow(0, 0, 1) + scale.log()),
        };
        if count == of_scale {
            return first;
        }
        Tensor::cat(vec![first, phi.narrow(0, of_scale, count - of_scale)], 0)
    }
}
