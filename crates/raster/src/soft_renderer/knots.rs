use softrast_softness::Softness;
use softrast_tensor::DType;

use crate::Silhouette;

/// Parameters that differ by at most this, relative to the larger of 1 and themselves, count as equal.
const SAME: f64 = 1e-12;

/// Support and knots for the parameters `phi`.
#[derive(Clone, Debug)]
pub(super) struct Knots<S> {
    pub(super) phi: Vec<f64>,
    /// Whether the CPU draws, and the float type.
    pub(super) drawn: (bool, DType),
    /// Number of faces that the knots are valid for.
    pub(super) room: usize,
    pub(super) silhouette: Silhouette<S>,
}

impl<S: Softness> Knots<S> {
    /// Knots for parameters `phi`, if their softness is that of these knots, stretched.
    pub(super) fn stretched_to(&self, phi: &[f64]) -> Option<Self> {
        if self.phi == phi {
            return Some(self.clone());
        }
        let widened = stretch(self.silhouette.softness(), &self.phi, phi)?;
        let silhouette = self.silhouette.stretched(widened)?;
        Some(Self { phi: phi.to_vec(), silhouette, ..*self })
    }
}

impl<S: Softness> PartialEq for Knots<S> {
    fn eq(&self, other: &Self) -> bool {
        self.phi == other.phi && self.silhouette.profile() == other.silhouette.profile()
    }
}

/// The factor by which a step with parameters `now` is stretched relative to one with `before`, if they differ by nothing else.
pub(crate) fn stretch(softness: &impl Softness, before: &[f64], now: &[f64]) -> Option<f64> {
    let factor = softness.scale(now) / softness.scale(before);
    let stretched = softness.with_scale_values(before, factor);
    let same = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME * b.abs().max(1.0);
    stretched.iter().zip(now).all(same).then(|| softness.width(now) / softness.width(before))
}
