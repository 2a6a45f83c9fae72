use serde::{Deserialize, Serialize};
use softrast_tensor::{Backend, Tensor};

use crate::{
    Family, Softness,
    softness::{curve, forward},
};

/// A family applied to the signed distance of an edge, or to its signed square.
///
/// The argument `x` of [`Softness`] is the signed distance d in NDC, positive inside. The argument of the family is d for
/// [`EdgeSoftness::new`], and `d |d|`, with a scale in NDC², for [`EdgeSoftness::squared`].
///
/// Source: Liu et al. 2019, Eq. 1 (squared); Wu et al. 2024, Sec. 4.1.
///
/// ```
/// use softrast_softness::{EdgeSoftness, Family, Softness};
///
/// let [plain, squared] = [EdgeSoftness::new, EdgeSoftness::squared].map(|edge| edge(Family::Logistic));
/// assert!(!plain.scale_is_squared() && squared.scale_is_squared());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a family such as {\"family\": \"gauss\", \"squared\": false}"
)]
pub struct EdgeSoftness {
    /// The shape of the step.
    pub family: Family,
    squared: bool,
}

impl EdgeSoftness {
    /// The family on the signed distance d, with a scale in NDC.
    pub const fn new(family: Family) -> Self {
        Self { family, squared: false }
    }

    /// The family on the signed square `d |d|` of the distance, with a scale in NDC².
    pub const fn squared(family: Family) -> Self {
        Self { family, squared: true }
    }

    /// The argument of the family at the distance `d`.
    fn argument<B: Backend, const D: usize>(&self, d: Tensor<B, D>) -> Tensor<B, D> {
        if self.squared { d.clone() * d.abs() } else { d }
    }

    /// Converts a derivative with respect to the argument of the family into one with respect to the distance `d`.
    fn by_distance<B: Backend, const D: usize>(
        &self,
        derivative: Tensor<B, D>,
        d: Tensor<B, D>,
    ) -> Tensor<B, D> {
        if self.squared { derivative * d.abs() * 2.0 } else { derivative }
    }
}

impl Softness for EdgeSoftness {
    curve!(self.value(phi, x) => self.family.value(phi, self.argument(x)));
    curve!(self.density(phi, x) => {
        let density = self.family.density(phi, self.argument(x.clone()));
        self.by_distance(density, x)
    });

    curve!(self.optical_depth(phi, x) => self.family.optical_depth(phi, self.argument(x)));
    curve!(self.hazard(phi, x) => {
        let hazard = self.family.hazard(phi, self.argument(x.clone()));
        self.by_distance(hazard, x)
    });

    curve!([self.depth_and_hazard(phi, x); 2] => {
        let [depth, hazard] = self.family.depth_and_hazard(phi, self.argument(x.clone()));
        [depth, self.by_distance(hazard, x)]
    });

    curve!(self.log_value(phi, x) => self.family.log_value(phi, self.argument(x)));

    curve!([self.log_value_and_slope(phi, x); 2] => {
        let [value, slope] = self.family.log_value_and_slope(phi, self.argument(x.clone()));
        [value, self.by_distance(slope, x)]
    });

    forward!(family);

    fn scale_is_squared(&self) -> bool {
        self.squared
    }
}
