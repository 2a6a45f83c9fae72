use softrast_kernel::{
    Grid,
    blend::{DepthGrid, NOTHING},
};
use softrast_softness::{
    DepthSoftness, EdgeSoftness, Family, Mirrored, Softness, settled_beyond, support,
};
use softrast_tensor::{Backend, DType, Tensor, numbers};

use crate::curve::{CubicCurve, FAR, precise, rounding, settled_until};

/// Distance used for infinity; its square fits an f32.
const LIMIT: f64 = 1e18;
/// The least optical depth that differs from its limit by more than its rounding.
const ROUNDING: f64 = 1e-12;

/// Minus the logarithm of a softness, as a piecewise cubic function of the squared distance.
///
/// `-ln s(x)` is the optical depth of the mirrored step at `-x`, whose inner side is outside the face. An absolute error of a logarithm is
/// a relative error of the weight, and errors of at most ρ of the logarithms of all weights move their mean by at most `ρ / 2` times the
/// range of the averaged values, to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogCurve<S> {
    softness: Mirrored<S>,
    curve: CubicCurve,
    /// Error of the table, as a multiple of the requested one.
    pub(crate) error: f64,
}

/// Required precision of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Precision {
    /// Relative error of a weight.
    pub(crate) accuracy: f64,
    /// Logarithm of a negligible weight.
    pub(crate) least: f64,
    /// Floor subtracted from a weight.
    pub(crate) floor: f64,
}

impl Precision {
    /// Error of a weight, as a multiple of the required one. `rounding` is that of a number of size 1.
    fn error(&self, exact: f64, interpolated: f64, rounding: f64) -> f64 {
        let relative = self.accuracy + rounding * exact.abs();
        let logarithm = (exact - interpolated).abs() / relative;
        let weights = [exact, interpolated].map(|q| (-q).exp());
        let [exact, interpolated] = weights.map(|weight| (weight - self.floor).max(0.0));
        // A weight with a floor is resolved to a fraction of the floor only.
        let negligible = 0.5 * self.least.exp().max(0.1 * NOTHING * self.floor);
        let bound = relative * exact + rounding * self.floor + negligible;
        let weight = (exact - interpolated).abs() / bound;
        if self.floor > 0.0 { weight } else { logarithm.min(weight) }
    }
}

impl<S: Softness> LogCurve<S> {
    /// A table for the parameters `phi`.
    pub(crate) fn new<B: Backend>(
        softness: S,
        phi: &[f64],
        precision: Precision,
        device: &B::Device,
    ) -> Self {
        let softness = Mirrored(softness);
        let Precision { accuracy, least, floor } = precision;
        let parameters = precise::<B>(phi, device);
        let depths = |x: &[f64]| {
            numbers(softness.optical_depth(parameters.clone(), precise::<B>(x, device)))
        };
        let outer = support::<B>(&softness, phi, accuracy / 2.0, device).outer;
        // Up to where the weight is negligible, or at its limit.
        let close = if floor > 0.0 { least.exp() / floor } else { accuracy };
        let close = close.min(accuracy).max(ROUNDING) / 2.0;
        let limit = depths(&[LIMIT])[0];
        let inner = settled_beyond(depths, |q| q >= -least || (q - limit).abs() <= close);
        let from = || {
            let settled = |edge: f64, q: f64| (q - edge).abs() <= accuracy.max(ROUNDING) / 2.0;
            settled_until(depths, [outer, inner], settled)
        };
        let curve = |x: Tensor<B, 1>| softness.depth_and_hazard(parameters.clone(), x);
        let rounding = rounding::<B>(device);
        let miss = |exact: f64, interpolated: f64| precision.error(exact, interpolated, rounding);
        let (curve, error) =
            CubicCurve::chosen::<B>(curve, [outer, inner], from, &FAR, miss, DType::F32, device);
        Self { softness, curve, error }
    }

    /// The curve of the softness stretched by `factor` along its argument, with the same precision; `None` if it has to be chosen anew.
    pub(crate) fn stretched(&self, factor: f64) -> Option<Self> {
        Some(Self { curve: self.curve.stretched(factor)?, ..self.clone() })
    }

    /// The layout of the cells.
    pub(crate) fn grid(&self) -> Grid {
        self.curve.grid
    }

    /// Coefficients of the cubics, `[rows, 4]`, in the float type of `phi` `[parameters]`.
    pub(crate) fn table<B: Backend>(&self, phi: Tensor<B, 1>) -> Tensor<B, 2> {
        let like = (&phi.device(), phi.dtype());
        self.curve.table(|x| self.softness.depth_and_hazard(phi.clone(), x), like)
    }
}

/// Logarithms of depth weights, for a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DepthCurve {
    /// A family, over the distance from the near plane.
    Family(LogCurve<EdgeSoftness>),
    /// The reversed exponential: its logarithm is a straight line, up to 0.
    Exponential,
    /// The network: without biases it is a straight line on each side of nearness 0.
    Mlp,
}

impl DepthCurve {
    /// See [`LogCurve::new`].
    pub(crate) fn new<B: Backend>(
        softness: DepthSoftness,
        phi: &[f64],
        precision: Precision,
        device: &B::Device,
    ) -> Self {
        match softness {
            DepthSoftness::Family(Family::Exp) => Self::Exponential,
            DepthSoftness::Family(family) => {
                // The distance from the plane is in units of the distance between the planes.
                let softness = EdgeSoftness::new(family);
                Self::Family(LogCurve::new::<B>(softness, phi, precision, device))
            }
            DepthSoftness::Mlp => Self::Mlp,
        }
    }

    /// Error of the table, as a multiple of the requested one.
    pub(crate) fn error(&self) -> f64 {
        match self {
            Self::Family(curve) => curve.error,
            Self::Exponential | Self::Mlp => 0.0,
        }
    }

    pub(crate) fn grid(&self) -> DepthGrid {
        match self {
            Self::Family(curve) => DepthGrid::Table(curve.grid()),
            Self::Exponential => DepthGrid::Exponential,
            Self::Mlp => DepthGrid::Line { floor: softrast_softness::OPAQUE },
        }
    }

    /// See [`LogCurve::table`]. For an exponential, one row: the slope of its logarithm and its value at nearness 1. For a network, one
    /// row: its values at nearness 1 and -1.
    pub(crate) fn table<B: Backend>(&self, phi: Tensor<B, 1>) -> Tensor<B, 2> {
        match self {
            Self::Family(curve) => curve.table(phi),
            Self::Exponential => {
                let per_scale = phi.clone().narrow(0, 0, 1).neg().exp();
                let shift = phi.narrow(0, 1, 1).neg();
                let zero = shift.zeros_like();
                Tensor::cat(vec![per_scale, shift, zero.clone(), zero], 0).reshape([1, 4])
            }
            Self::Mlp => {
                let slopes = DepthSoftness::mlp_at_ends(phi);
                let zero = slopes.clone() * 0.0;
                Tensor::cat(vec![slopes, zero], 0).reshape([1, 4])
            }
        }
    }
}

#[cfg(all(test, feature = "ndarray"))]
mod tests {
    use softrast_tensor::NdArray;

    use super::*;
    use crate::weighting::floor;

    #[test]
    fn every_family_keeps_the_precision_that_is_asked_for() {
        for family in Family::ALL {
            for squared in [false, true] {
                let softness =
                    if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
                let phi = softness.default_phi(if squared { 1e-4 } else { 1e-2 });
                let floor = floor(&softness);
                let precision = Precision { accuracy: 5e-6, least: -27.0, floor };
                let device = Default::default();
                let curve = LogCurve::new::<NdArray<f64>>(softness, &phi, precision, &device);
                let error = curve.error;
                // This law increases faster at its start than knots can resolve.
                let most = if family == Family::GammaForward { 200.0 } else { 1.0 };
                assert!(
                    error <= most,
                    "{family}, squared {squared}: {error} with {:?}",
                    curve.grid()
                );
            }
        }
    }

    #[test]
    fn weights_beyond_the_range_of_floats_have_a_place() {
        let softness = EdgeSoftness::new(Family::Exp);
        let phi = softness.default_phi(1e-4);
        let precision = Precision { accuracy: 1e-6, least: -1e4, floor: 0.0 };
        let curve = LogCurve::new::<NdArray<f64>>(softness, &phi, precision, &Default::default());
        assert!((curve.grid().inner - 1.0).abs() < 1e-4, "{curve:?}");
    }
}
