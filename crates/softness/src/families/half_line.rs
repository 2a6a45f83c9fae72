use std::fmt::Debug;

use burn::tensor::{Tensor, backend::Backend};

use crate::{
    Softness,
    math::{FAR, bounded_depth, bounded_hazard, ln_scale, optical_depth_of, parameter, per_scale},
    softness::curve,
};

/// A distribution on the half line `y >= 0`, in units of the scale.
///
/// φ begins with the logarithm of the scale and ends with the shift in scales; between them are the
/// logarithms of the shapes. Every method sees `0 <= y <= FAR` and must stay finite there.
pub(crate) trait HalfLine: Clone + Debug + Send + Sync + 'static {
    /// Positive parameters of the law, to start from; φ holds their logarithms.
    const SHAPES: &'static [f64] = &[];

    /// The distribution function `F(y)` and its complement `1 - F(y)`, each with its own digits.
    fn split<B: Backend, const D: usize>(
        phi: &Tensor<B, 1>,
        y: Tensor<B, D>,
    ) -> (Tensor<B, D>, Tensor<B, D>);

    /// `dF/dy`.
    fn slope<B: Backend, const D: usize>(phi: &Tensor<B, 1>, y: Tensor<B, D>) -> Tensor<B, D>;

    /// `-ln(1 - F(y))`.
    fn depth<B: Backend, const D: usize>(phi: &Tensor<B, 1>, y: Tensor<B, D>) -> Tensor<B, D> {
        let (below, above) = Self::split(phi, y);
        optical_depth_of(below, above)
    }

    /// The derivative of [`HalfLine::depth`].
    fn depth_slope<B: Backend, const D: usize>(
        phi: &Tensor<B, 1>,
        y: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let (_, above) = Self::split(phi, y.clone());
        Self::slope(phi, y) / above
    }

    /// Parameters to start from: no shift.
    fn default_phi(scale: f64) -> Vec<f64> {
        let shapes = Self::SHAPES.iter().map(|shape| shape.ln());
        [ln_scale(scale)].into_iter().chain(shapes).chain([0.0]).collect()
    }
}

/// A one-sided law as it stands: `s = F(x / scale + shift)`, which is 0 outside and rises inside.
///
/// It never reaches 1 at a finite distance, so its optical depth is exact and grows without bound.
/// At the kink (`x = -shift scale`) density and hazard are those of the side of larger x.
///
/// Source: Petersen et al. 2022, Table 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Forward<L>(
    /// The law, for example [`Exp`](super::Exp).
    pub L,
);

/// A one-sided law mirrored: `s = 1 - F(shift - x / scale)`, which is 1 inside and decays outside.
///
/// It reaches 1, so its optical depth is bounded: see [`OPAQUE`](crate::OPAQUE). At the kink
/// (`x = shift scale`) density and hazard are those of the side of smaller x.
///
/// Source: Wu et al. 2024, Sec. 4.2: the rows Exp and Gamma of shape and pose are these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reversed<L>(
    /// The law, for example [`Exp`](super::Exp).
    pub L,
);

/// `sign x / scale + shift`, where the law begins at 0.
fn law_distance<L: HalfLine, B: Backend, const D: usize>(
    phi: &Tensor<B, 1>,
    x: Tensor<B, D>,
    sign: f64,
) -> Tensor<B, D> {
    x * (per_scale(phi) * sign) + parameter(phi, L::SHAPES.len() + 1)
}

/// `f(max(y, 0))` where the law has begun, 0 before.
fn where_begun<B: Backend, const D: usize>(
    y: Tensor<B, D>,
    f: impl FnOnce(Tensor<B, D>) -> Tensor<B, D>,
) -> Tensor<B, D> {
    let before = y.clone().lower_elem(0.0);
    f(y.clamp(0.0, FAR)).mask_fill(before, 0.0)
}

impl<L: HalfLine> Softness for Forward<L> {
    fn parameters(&self) -> usize {
        L::SHAPES.len() + 2
    }

    fn logarithms(&self) -> usize {
        L::SHAPES.len() + 1
    }

    fn default_phi(&self, scale: f64) -> Vec<f64> {
        L::default_phi(scale)
    }

    curve!(self.value(phi, x) => {
        where_begun(law_distance::<L, B, D>(&phi, x, 1.0), |y| L::split(&phi, y).0)
    });

    curve!(self.density(phi, x) => {
        let y = law_distance::<L, B, D>(&phi, x, 1.0);
        where_begun(y, |y| L::slope(&phi, y)) * per_scale(&phi)
    });

    curve!(self.optical_depth(phi, x) => {
        where_begun(law_distance::<L, B, D>(&phi, x, 1.0), |y| L::depth(&phi, y))
    });

    curve!(self.hazard(phi, x) => {
        let y = law_distance::<L, B, D>(&phi, x, 1.0);
        where_begun(y, |y| L::depth_slope(&phi, y)) * per_scale(&phi)
    });
}

impl<L: HalfLine> Softness for Reversed<L> {
    fn parameters(&self) -> usize {
        L::SHAPES.len() + 2
    }

    fn logarithms(&self) -> usize {
        L::SHAPES.len() + 1
    }

    fn default_phi(&self, scale: f64) -> Vec<f64> {
        L::default_phi(scale)
    }

    curve!(self.value(phi, x) => {
        let y = law_distance::<L, B, D>(&phi, x, -1.0);
        L::split(&phi, y.clamp(0.0, FAR)).1
    });

    curve!(self.density(phi, x) => {
        let y = law_distance::<L, B, D>(&phi, x, -1.0);
        where_begun(y, |y| L::slope(&phi, y)) * per_scale(&phi)
    });

    curve!(self.optical_depth(phi, x) => {
        let y = law_distance::<L, B, D>(&phi, x, -1.0);
        let (open, covered) = L::split(&phi, y.clamp(0.0, FAR));
        bounded_depth(covered, open)
    });

    curve!(self.hazard(phi, x) => {
        let y = law_distance::<L, B, D>(&phi, x, -1.0);
        let slope = where_begun(y, |y| {
            let (open, _) = L::split(&phi, y.clone());
            bounded_hazard(L::slope(&phi, y), open)
        });
        slope * per_scale(&phi)
    });
}
