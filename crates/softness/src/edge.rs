use burn::tensor::{Tensor, backend::Backend};
use serde::{Deserialize, Serialize};

use crate::{Family, Softness};

/// A family applied to the signed distance of an edge, or to its signed square.
///
/// `x` of [`Softness`] is here the signed distance d in NDC, positive inside. If `squared`, the
/// family sees `d |d|`, so that its scale is in NDC²; otherwise it sees d.
///
/// Source: Liu et al. 2019, Eq. 1 (squared); Wu et al. 2024, Sec. 4.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EdgeSoftness {
    /// The shape of the step.
    pub family: Family,
    /// Whether the family sees the signed square of the distance.
    pub squared: bool,
}

impl EdgeSoftness {
    /// Parameters to start from, see [`Family::default_phi`]; `scale` is in NDC, or NDC² if
    /// `squared`.
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    pub fn default_phi(&self, scale: f64) -> Vec<f64> {
        self.family.default_phi(scale)
    }

    /// What the family sees of the distance `d`.
    fn argument<B: Backend, const D: usize>(&self, d: Tensor<B, D>) -> Tensor<B, D> {
        if self.squared { d.clone() * d.abs() } else { d }
    }

    /// Turns a derivative by the argument of the family into one by the distance `d`.
    fn by_distance<B: Backend, const D: usize>(
        &self,
        derivative: Tensor<B, D>,
        d: Tensor<B, D>,
    ) -> Tensor<B, D> {
        if self.squared { derivative * d.abs() * 2.0 } else { derivative }
    }
}

impl Softness for EdgeSoftness {
    fn parameters(&self) -> usize {
        self.family.parameters()
    }

    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        self.family.value(phi, self.argument(x))
    }

    fn density<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let density = self.family.density(phi, self.argument(x.clone()));
        self.by_distance(density, x)
    }

    fn optical_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        self.family.optical_depth(phi, self.argument(x))
    }

    fn hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let hazard = self.family.hazard(phi, self.argument(x.clone()));
        self.by_distance(hazard, x)
    }
}
