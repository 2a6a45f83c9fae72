use std::fmt::Debug;

use softrast_tensor::{Backend, Tensor};

use crate::{
    Softness,
    math::{FAR, bounded_depth, bounded_hazard, ln_scale, optical_depth_of, parameter, per_scale},
    softness::curve,
};

/// A distribution on the half line `y >= 0`, in units of the scale.
///
/// φ starts with the logarithm of the scale and ends with the shift in scales; between them are the logarithms of the shapes. Arguments of
/// every method are in `0 <= y <= FAR`, where results must be finite.
pub(crate) trait HalfLine: Clone + Debug + Send + Sync + 'static {
    /// Initial positive parameters of the law; φ holds their logarithms.
    const SHAPES: &'static [f64] = &[];

    /// The law at each distance.
    fn law<B: Backend, const D: usize>(phi: &Tensor<B, 1>, y: Tensor<B, D>) -> Law<B, D>;

    /// `-ln(1 - F(y))` and its derivative.
    fn depth<B: Backend, const D: usize>(phi: &Tensor<B, 1>, y: Tensor<B, D>) -> [Tensor<B, D>; 2] {
        let Law { below, above, slope } = Self::law(phi, y);
        [optical_depth_of(below, above.clone()), slope / above]
    }

    /// Initial parameters, without a shift.
    fn default_phi(scale: f64) -> Vec<f64> {
        let shapes = Self::SHAPES.iter().map(|shape| shape.ln());
        [ln_scale(scale)].into_iter().chain(shapes).chain([0.0]).collect()
    }
}

/// A distribution at one set of distances.
pub(crate) struct Law<B: Backend, const D: usize> {
    /// `F(y)`.
    pub(crate) below: Tensor<B, D>,
    /// `1 - F(y)`, computed without cancellation.
    pub(crate) above: Tensor<B, D>,
    /// `dF/dy`.
    pub(crate) slope: Tensor<B, D>,
}

/// A one-sided law in its own direction: `s = F(x / scale + shift)`, which is 0 outside and increases inside.
///
/// It never reaches 1 at a finite distance, so its optical depth is exact and unbounded. At the kink (`x = -shift scale`) density and
/// hazard are those of the side of larger x.
///
/// Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Forward<L>(
    /// The law, for example [`Exp`](super::Exp).
    pub L,
);

/// A mirrored one-sided law: `s = 1 - F(shift - x / scale)`, which is 1 inside and decays outside.
///
/// It reaches 1, so its optical depth is bounded: see [`OPAQUE`](crate::OPAQUE). At the kink
/// (`x = shift scale`) density and hazard are those of the side of smaller x.
///
/// Source: Wu et al. 2024, Sec. 4.2: the rows Exp and Gamma of shape and pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reversed<L>(
    /// The law, for example [`Exp`](super::Exp).
    pub L,
);

/// `sign x / scale + shift`, where the law starts at 0.
fn law_distance<L: HalfLine, B: Backend, const D: usize>(
    phi: &Tensor<B, 1>,
    x: Tensor<B, D>,
    sign: f64,
) -> Tensor<B, D> {
    x * (per_scale(phi) * sign) + parameter(phi, L::SHAPES.len() + 1)
}

/// `f(y)` for `y >= 0`, 0 before.
fn where_begun<B: Backend, const D: usize, const N: usize>(
    y: Tensor<B, D>,
    f: impl FnOnce(Tensor<B, D>) -> [Tensor<B, D>; N],
) -> [Tensor<B, D>; N] {
    let before = y.clone().lower_elem(0.0);
    f(y.clamp(0.0, FAR)).map(|it| it.mask_fill(before.clone(), 0.0))
}

/// Methods that differ only in the `sign` of [`law_distance`].
macro_rules! shared {
    ($sign:literal) => {
        fn parameters(&self) -> usize {
            L::SHAPES.len() + 2
        }

        fn logarithms(&self) -> usize {
            L::SHAPES.len() + 1
        }

        fn default_phi(&self, scale: f64) -> Vec<f64> {
            L::default_phi(scale)
        }

        curve!(self.density(phi, x) => {
            let y = law_distance::<L, B, D>(&phi, x, $sign);
            let [slope] = where_begun(y, |y| [L::law(&phi, y).slope]);
            slope * per_scale(&phi)
        });

        curve!(self.optical_depth(phi, x) => {
            let [depth, _] = self.depth_and_hazard(phi, x);
            depth
        });

        curve!(self.hazard(phi, x) => {
            let [_, hazard] = self.depth_and_hazard(phi, x);
            hazard
        });
    };
}

impl<L: HalfLine> Softness for Forward<L> {
    shared!(1.0);

    curve!(self.value(phi, x) => {
        let [below] = where_begun(law_distance::<L, B, D>(&phi, x, 1.0), |y| [L::law(&phi, y).below]);
        below
    });

    curve!([self.depth_and_hazard(phi, x); 2] => {
        let y = law_distance::<L, B, D>(&phi, x, 1.0);
        let [depth, slope] = where_begun(y, |y| L::depth(&phi, y));
        [depth, slope * per_scale(&phi)]
    });
}

impl<L: HalfLine> Softness for Reversed<L> {
    shared!(-1.0);

    curve!(self.value(phi, x) => {
        let y = law_distance::<L, B, D>(&phi, x, -1.0);
        L::law(&phi, y.clamp(0.0, FAR)).above
    });

    curve!([self.depth_and_hazard(phi, x); 2] => {
        let y = law_distance::<L, B, D>(&phi, x, -1.0);
        let before = y.clone().lower_elem(0.0);
        let Law { below: open, above: covered, slope } = L::law(&phi, y.clamp(0.0, FAR));
        let hazard = bounded_hazard(slope, open.clone()).mask_fill(before, 0.0);
        [bounded_depth(covered, open), hazard * per_scale(&phi)]
    });
}
