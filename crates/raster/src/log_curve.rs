use std::iter;

use burn::tensor::{Tensor, backend::Backend};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness, numbers, support};

use crate::{
    Profile, TConorm,
    kernel::{Grid, blend::DepthGrid},
    profile::{FAR, PLACES, Reached, Sample, dense, precise, refined, samples, settled_until},
    weighting::NOTHING,
};

/// The nearest and the farthest distance at which a softness is asked how much it is, as in [`support`], in the unit of its argument.
const NEAREST: f64 = 1e-12;
const FARTHEST: f64 = 1e6;
/// Stands for an infinite distance; its square fits an f32.
const LIMIT: f64 = 1e18;
/// Distances that are looked at, 4 % apart, and those by which each refinement divides what lies between two.
const COARSE: usize = 1024;
const FINE: usize = 64;
const REFINEMENTS: usize = 2;
/// The least optical depth that differs from its limit by more than it is rounded by.
const ROUNDING: f64 = 1e-12;

/// Minus the logarithm of a softness, as a piecewise cubic function of the squared distance.
///
/// `-ln s(x)` is the optical depth of the mirrored step at `-x`. So the table is a [`Profile`] of that, under the probabilistic sum, with
/// another idea of what is exact: an absolute error of a logarithm is a relative one of the weight, and an error ρ of the logarithms of
/// all weights moves their mean by at most `ρ / 2` times the range of what is averaged, to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogCurve {
    softness: EdgeSoftness,
    pub(crate) grid: Grid,
    /// How far it is off, in multiples of what was asked for.
    pub(crate) error: f64,
}

/// What a table is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Precision {
    /// Relative error of a weight.
    pub(crate) accuracy: f64,
    /// Logarithm of a weight that may be left out.
    pub(crate) least: f64,
    /// What is taken off a weight before it counts.
    pub(crate) floor: f64,
}

impl Precision {
    /// How far a weight is off, in multiples of what is asked for. `rounding` is that of a number of size 1.
    fn error(&self, exact: f64, interpolated: f64, rounding: f64) -> f64 {
        let relative = self.accuracy + rounding * exact.abs();
        let logarithm = (exact - interpolated).abs() / relative;
        let weights = [exact, interpolated].map(|q| (-q).exp());
        let [exact, interpolated] = weights.map(|weight| (weight - self.floor).max(0.0));
        // A weight that is held up from 0 is not known to more than a part of that.
        let negligible = 0.5 * self.least.exp().max(0.1 * NOTHING * self.floor);
        let bound = relative * exact + rounding * self.floor + negligible;
        let weight = (exact - interpolated).abs() / bound;
        if self.floor > 0.0 { weight } else { logarithm.min(weight) }
    }
}

impl LogCurve {
    /// A table for the parameters `phi`.
    pub(crate) fn new<B: Backend>(
        softness: EdgeSoftness,
        phi: &[f64],
        precision: Precision,
        device: &B::Device,
    ) -> Self {
        let softness = EdgeSoftness { family: softness.family.mirrored(), ..softness };
        let Precision { accuracy, least, floor } = precision;
        let outer = support::<B>(&softness, phi, accuracy / 2.0, device).outer;
        // Until the weight is negligible, or at its limit.
        let close = if floor > 0.0 { least.exp() / floor } else { accuracy };
        let close = close.min(accuracy).max(ROUNDING) / 2.0;
        let inner = settled_beyond::<B>(&softness, phi, -least, close, device);
        let from = || {
            let settled = |edge: f64, q: f64| (q - edge).abs() <= accuracy.max(ROUNDING) / 2.0;
            settled_until::<B>(&softness, phi, [outer, inner], settled, device)
        };
        let missed = |grid: Grid, places: &[f64]| {
            let (samples, rounding) = samples::<B>(&softness, depths(grid), phi, places, device);
            let mut reached = Reached::NOTHING;
            for Sample { exact, interpolated, innermost } in samples {
                let error = precision.error(exact, interpolated, rounding);
                let place = if innermost { &mut reached.innermost } else { &mut reached.rest };
                *place = place.max(error);
            }
            reached
        };
        let (grid, reached) = refined([outer, inner], from, &FAR, |grid| missed(grid, &PLACES));
        let mut error = reached.most();
        if error > 1.0 {
            error = missed(grid, &dense()).most();
        }
        Self { softness, grid, error }
    }

    /// The same softness stretched by `factor` along its argument, to the same precision; None where it has to be chosen anew.
    pub(crate) fn stretched(self, factor: f64) -> Option<Self> {
        Some(Self { grid: depths(self.grid).stretched(factor)?.grid, ..self })
    }

    /// Coefficients of the cubics, `[rows, 4]`, in the float type of `phi` `[parameters]`.
    pub(crate) fn table<B: Backend>(&self, phi: Tensor<B, 1>) -> Tensor<B, 2> {
        depths(self.grid).table(&self.softness, phi)
    }
}

/// A profile of optical depths with these cells.
fn depths(grid: Grid) -> Profile {
    Profile { grid, t_conorm: TConorm::Probabilistic, error: 0.0, rough: false }
}

/// Logarithms of weights by depth, for a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DepthCurve {
    /// A family, over the distance from the near plane.
    Family(LogCurve),
    /// The reversed exponential: its logarithm is a straight line, until it is 0.
    Exponential,
    /// The network: without biases it is a straight line on each side of nearness 0.
    Mlp,
}

impl DepthCurve {
    /// As [`LogCurve::new`].
    pub(crate) fn new<B: Backend>(
        softness: DepthSoftness,
        phi: &[f64],
        precision: Precision,
        device: &B::Device,
    ) -> Self {
        match softness {
            DepthSoftness::Family(Family::Exp) => Self::Exponential,
            DepthSoftness::Family(family) => {
                // The distance from the plane is in units of that between the planes.
                let softness = EdgeSoftness { family, squared: false };
                Self::Family(LogCurve::new::<B>(softness, phi, precision, device))
            }
            DepthSoftness::Mlp => Self::Mlp,
        }
    }

    /// How far it is off, in multiples of what was asked for.
    pub(crate) fn error(&self) -> f64 {
        match self {
            Self::Family(curve) => curve.error,
            Self::Exponential | Self::Mlp => 0.0,
        }
    }

    pub(crate) fn grid(&self) -> DepthGrid {
        match self {
            Self::Family(curve) => DepthGrid::Table(curve.grid),
            Self::Exponential => DepthGrid::Exponential,
            Self::Mlp => DepthGrid::Line { floor: softrast_softness::OPAQUE },
        }
    }

    /// As [`LogCurve::table`]; of an exponential one row, with the slope of its logarithm and its value at nearness 1; of a network one row,
    /// with its values at nearness 1 and -1.
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

/// The distance on the inner side beyond which an optical depth is at least `depth`, or as `close` as this to its limit.
///
/// Looked for as in [`support`], but without taking an exponential: depths may be beyond the range of weights.
fn settled_beyond<B: Backend>(
    softness: &EdgeSoftness,
    phi: &[f64],
    depth: f64,
    close: f64,
    device: &B::Device,
) -> f64 {
    let depths = |x: &[f64]| {
        numbers(softness.optical_depth(precise::<B>(phi, device), precise::<B>(x, device)))
    };
    let limit = depths(&[LIMIT])[0];
    let unsettled = |&q: &f64| q < depth && (q - limit).abs() > close;
    let [mut near, mut far] = [NEAREST, FARTHEST];
    for count in iter::once(COARSE).chain([FINE; REFINEMENTS]) {
        let ratio = (far / near).ln() / (count - 1) as f64;
        let places: Vec<f64> = (0..count).map(|k| near * (ratio * k as f64).exp()).collect();
        match depths(&places).iter().rposition(unsettled) {
            None => return near,
            Some(last) if last + 1 == count => return f64::INFINITY,
            Some(last) => [near, far] = [places[last], places[last + 1]],
        }
    }
    far
}

#[cfg(all(test, feature = "ndarray"))]
mod tests {
    use burn::backend::NdArray;

    use super::*;
    use crate::weighting::floor;

    #[test]
    fn every_family_keeps_the_precision_that_is_asked_for() {
        for family in Family::ALL {
            for squared in [false, true] {
                let softness = EdgeSoftness { family, squared };
                let phi = softness.default_phi(if squared { 1e-4 } else { 1e-2 });
                let floor = floor(&softness);
                let precision = Precision { accuracy: 5e-6, least: -27.0, floor };
                let device = Default::default();
                let curve = LogCurve::new::<NdArray<f64>>(softness, &phi, precision, &device);
                let error = curve.error;
                // Where the law of this one begins, it rises faster than knots follow.
                let most = if family == Family::GammaForward { 200.0 } else { 1.0 };
                assert!(
                    error <= most,
                    "{family}, squared {squared}: {error} with {:?}",
                    curve.grid
                );
            }
        }
    }

    #[test]
    fn weights_beyond_the_range_of_floats_have_a_place() {
        let softness = EdgeSoftness { family: Family::Exp, squared: false };
        let phi = softness.default_phi(1e-4);
        let mirrored = EdgeSoftness { family: Family::ExpForward, ..softness };
        let device = Default::default();
        let beyond = settled_beyond::<NdArray<f64>>(&mirrored, &phi, 1e4, 1e-6, &device);
        assert!((beyond - 1.0).abs() < 1e-4, "{beyond}");
    }
}
