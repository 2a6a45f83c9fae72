use softrast_softness::{DepthSoftness, EdgeSoftness, OPAQUE, Softness};
use softrast_tensor::{Backend, Tensor, vector};

use crate::HostBackend;

/// Depths beyond this, in world units, are not drawn in colour: one over the square of a depth fits an f32.
pub(crate) const FARTHEST_SEEN: f64 = 1e15;

/// The weight of a face at a pixel: `w = s(d) b(z)`, for the signed distance d in NDC and the depth z of the point of the face nearest to
/// the pixel.
///
/// The argument of the depth softness is the nearness of z: 1 at the first plane, 0 at the second ([`nearness`](crate::nearness)). The
/// planes do not clip: a point in front of the first or behind the second has the weight that the softness has there.
///
/// Source: Wu et al. 2024, Eq. 3 and 4.
///
/// ```
/// use softrast_raster::{ColourRenderer, HostBackend, Weighting};
/// use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
/// use softrast_tensor::{numbers, vector};
///
/// let (edge, depth) = (EdgeSoftness::new(Family::Gauss), DepthSoftness::Family(Family::Exp));
/// let weighting = Weighting { edge, depth, planes: [1.0, 3.0] };
/// let phi = [edge.default_phi(0.01), depth.default_phi(0.5)];
/// // Half of the way between the planes divides a weight by e.
/// let log = numbers(weighting.log_weight_of_depth(vector::<HostBackend>(&phi[1]), vector(&[1.0, 2.0])));
/// assert!((log[0] - log[1] - 1.0).abs() < 1e-6);
/// let renderer = ColourRenderer::with_weighting([[0, 1, 2]].into(), 16, weighting, phi);
/// assert_eq!(renderer.weighting(), &weighting);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighting<S = EdgeSoftness> {
    /// `s`: the softness of the edge.
    pub edge: S,
    /// `b`: the softness of the depth.
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

/// The floor subtracted from an edge softness s: `(s - floor) / (1 - floor)` is used instead of s.
///
/// The logarithm of a softness that is 0 beyond some distance is clamped at that of [`OPAQUE`]; without the subtraction thousands of faces
/// far from a pixel would make up much of it. The floor is [`OPAQUE`] for such a softness, else 0.
pub(crate) fn floor(edge: &impl Softness) -> f64 {
    let phi = vector::<HostBackend>(&edge.default_phi(1.0));
    // The square still fits an f32.
    let limit = edge.log_value(phi, vector::<HostBackend>(&[-1e18]));
    let limit = f64::from(limit.into_scalar());
    if (limit - OPAQUE.ln()).abs() < 1e-3 { OPAQUE } else { 0.0 }
}
