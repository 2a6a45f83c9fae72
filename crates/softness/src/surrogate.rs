use serde::{Deserialize, Serialize};

use crate::EdgeSoftness;

/// A second softness whose slope stands for that of the first in the backward pass.
///
/// The image is that of the first, the gradient that of this one: a sharp image with a wide gradient.
/// What comes back is not the derivative of the image. Where the scale of the first moves along a
/// [`ScalePath`](crate::ScalePath), this one is seen at `d / scale(t)` too: it keeps its ratio to the
/// first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surrogate {
    /// Which softness.
    pub softness: EdgeSoftness,
    /// Its parameters φ, as many as [`Softness::parameters`](crate::Softness::parameters) says.
    pub phi: Vec<f64>,
}
