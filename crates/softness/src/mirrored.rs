use softrast_tensor::{Backend, Tensor};

use crate::{
    Softness,
    softness::{curve, forward},
};

/// The mirrored step `1 - s(-x)` of a softness, with the same parameters.
///
/// Its optical depth is `-ln s(-x)`: the table of a weight is a table of this optical depth.
///
/// ```
/// use softrast_softness::{Family, Mirrored, Softness};
/// use softrast_tensor::{NdArray, numbers, vector};
///
/// fn at(softness: impl Softness, x: f64) -> f64 {
///     let phi = vector::<NdArray>(&softness.default_phi(0.1));
///     numbers(softness.value(phi, vector(&[x])))[0]
/// }
/// let (mirrored, other) = (Mirrored(Family::GumbelMax), Family::GumbelMin);
/// assert!((at(mirrored, 0.05) - at(other, 0.05)).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mirrored<S>(pub S);

impl<S: Softness> Softness for Mirrored<S> {
    curve!(self.value(phi, x) => self.0.value(phi, x.neg()).neg() + 1.0);
    curve!(self.density(phi, x) => self.0.density(phi, x.neg()));
    curve!(self.optical_depth(phi, x) => self.0.log_value(phi, x.neg()).neg());
    curve!(self.hazard(phi, x) => {
        let [_, slope] = self.0.log_value_and_slope(phi, x.neg());
        slope
    });

    curve!([self.depth_and_hazard(phi, x); 2] => {
        let [value, slope] = self.0.log_value_and_slope(phi, x.neg());
        [value.neg(), slope]
    });

    curve!(self.log_value(phi, x) => self.0.optical_depth(phi, x.neg()).neg());

    curve!([self.log_value_and_slope(phi, x); 2] => {
        let [depth, hazard] = self.0.depth_and_hazard(phi, x.neg());
        [depth.neg(), hazard]
    });

    forward!(0);

    fn scale_is_squared(&self) -> bool {
        self.0.scale_is_squared()
    }

    fn width(&self, phi: &[f64]) -> f64 {
        self.0.width(phi)
    }
}
