use softrast_softness::{DepthSoftness, EdgeSoftness, OPAQUE, Softness};
use softrast_tensor::{Backend, Tensor, vector};

use crate::HostBackend;

/// Depths beyond this, in world units, are not drawn in colour: one over the square of a depth fits an f32.
pub(crate) const FARTHEST_SEEN: f64 = 1e15;

/// How much faces count at a pixel: `w = s(d) b(z)`, of the signed distance d in NDC and the depth z of the point of the face that is
/// nearest to the pixel.
///
/// The depth softness sees z by its nearness: 1 at the first plane, 0 at the second ([`nearness`](crate::nearness)). The planes do not
/// cut: a point in front of the first or behind the second has the weight that the softness gives it there.
///
/// Source: Wu et al. 2024, Eq. 3 and 4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighting<S = EdgeSoftness> {
    /// `s`: how much a face covers a pixel.
    pub edge: S,
    /// `b`: how much its depth counts.
    pub depth: DepthSoftness,
    /// Depths of nearness 1 and 0, in world units, ascending.
    pub planes: [f64; 2],
}

impl<S> Weighting<S> {
    /// Logarithm of the weight of points at a depth `[..]` in world units, under parameters φ of the depth softness.
    pub fn log_weight_of_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        depth: Tensor<B, D>,
    ) -> Tensor<B, D> {
        self.depth.log_weight(phi, crate::nearness(depth, self.planes))
    }
}

/// What is taken off an edge softness s before it counts, as `(s - floor) / (1 - floor)`.
///
/// A softness that is 0 from some distance on is held at [`OPAQUE`] by its logarithm, which would let thousands of faces that are
/// nowhere near a pixel make up much of it. For such a one it is that, for others 0.
pub(crate) fn floor(edge: &impl Softness) -> f64 {
    let phi = vector::<HostBackend>(&edge.default_phi(1.0));
    // Squared it still fits an f32.
    let limit = edge.log_value(phi, vector::<HostBackend>(&[-1e18]));
    let limit = f64::from(limit.into_scalar());
    if (limit - OPAQUE.ln()).abs() < 1e-3 { OPAQUE } else { 0.0 }
}
