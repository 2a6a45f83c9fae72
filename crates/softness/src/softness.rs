use std::fmt::Debug;

use softrast_tensor::{Autodiff, Backend, Tensor};

use crate::math::{bounded_depth, ln_scale, with_first};

/// A soft step: the coverage of a pixel by a face at signed distance `x`.
///
/// `x` is positive inside the face; its unit is NDC, or NDC² for a softness of the squared distance. All parameters are in one vector `phi`
/// `[parameters]`; those that must be positive are stored as logarithms. `phi` and `x` must have the same float type.
///
/// Only [`value`](Softness::value) is required, composed of tracked tensor ops; then gradients of any order reach `phi` and `x` through
/// every method. The other methods are provided for a softness whose first parameter is the logarithm of its scale. Override them for
/// formulas that are more exact or faster.
///
/// ```
/// use std::f64::consts::FRAC_1_PI;
///
/// use softrast_tensor::{Backend, Tensor};
/// use softrast_softness::Softness;
///
/// #[derive(Clone, Debug)]
/// struct Arctan;
///
/// impl Softness for Arctan {
///     fn value<B: Backend, const D: usize>(&self, phi: Tensor<B, 1>, x: Tensor<B, D>) -> Tensor<B, D> {
///         (x / phi.exp().reshape([1; D])).atan() * FRAC_1_PI + 0.5
///     }
/// }
///
/// assert_eq!(Arctan.default_phi(0.02), [0.02_f64.ln()]);
/// ```
///
/// This example has heavy tails: its coverage decreases with one over the distance, so that every face reaches every pixel. An image then
/// takes many times longer, and is opaque everywhere unless its scale is tiny. A renderer's `reach` is the distance in NDC up to which
/// faces are drawn; [`Truncated`](crate::Truncated) cuts off the tails.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no softness",
    note = "`Family`, `EdgeSoftness` and `DepthSoftness` are some; for one of your own implement `Softness::value`, and `Clone` and `Debug`"
)]
pub trait Softness: Clone + Debug + Send + Sync + 'static {
    /// Coverage `s(x)` in [0, 1], same shape as `x`; `phi` is `[parameters]`.
    fn value<B: Backend, const D: usize>(&self, phi: Tensor<B, 1>, x: Tensor<B, D>)
    -> Tensor<B, D>;

    /// Length of `phi`, at least 1. Provided: 1.
    fn parameters(&self) -> usize {
        1
    }

    /// Derivative `ds/dx`, in 1 / (unit of x), same shape as `x`.
    ///
    /// Provided: by automatic differentiation of [`value`](Softness::value), which must not call this method.
    fn density<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        slope(x, |x| self.value::<Autodiff<B>, D>(Tensor::from_inner(phi), x))
    }

    /// Optical depth `q = -ln(1 - s)`, at least 0, same shape as `x`.
    ///
    /// Silhouettes are sums of optical depths: `1 - Π (1 - sⱼ) = 1 - exp(-Σ qⱼ)` (Wu et al. 2024, Sec. 4.4). Provided:
    /// `-ln(OPAQUE + (1 - OPAQUE)(1 - s))`, see [`OPAQUE`](crate::OPAQUE). Override it if `1 - s` loses significant digits and s does not
    /// reach 1.
    fn optical_depth<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let covered = self.value(phi, x);
        bounded_depth(covered.clone(), covered.neg() + 1.0)
    }

    /// Hazard `dq/dx`, the derivative of the optical depth, same shape as `x`; finite wherever
    /// `density` is.
    ///
    /// Provided: by automatic differentiation of [`optical_depth`](Softness::optical_depth), which
    /// must not call this method.
    fn hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        slope(x, |x| self.optical_depth::<Autodiff<B>, D>(Tensor::from_inner(phi), x))
    }

    /// Optical depth and hazard, each of the shape of `x`, as required at every knot of a silhouette's table.
    ///
    /// Provided: by separate evaluation. Override it if both share most of their work.
    fn depth_and_hazard<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> [Tensor<B, D>; 2] {
        [self.optical_depth(phi.clone(), x.clone()), self.hazard(phi, x)]
    }

    /// `ln s(x)`, same shape as `x`; at most 0, and finite where `s` underflows. It is the edge weight of faces in colour images.
    ///
    /// Provided: `ln(OPAQUE + (1 - OPAQUE) s)`. Override it if s loses significant digits and does not reach 0.
    fn log_value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        let covered = self.value(phi, x);
        bounded_depth(covered.clone().neg() + 1.0, covered).neg()
    }

    /// `ln s(x)` and its derivative with respect to `x`, each of the shape of `x`, as required at every knot of a table of weights.
    ///
    /// Provided: by automatic differentiation of [`log_value`](Softness::log_value), which must not call this method.
    fn log_value_and_slope<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> [Tensor<B, D>; 2] {
        let slope = slope(x.clone(), |x| {
            self.log_value::<Autodiff<B>, D>(Tensor::from_inner(phi.clone()), x)
        });
        [self.log_value(phi, x), slope]
    }

    /// Initial parameters; `scale` is in the unit of x. Provided: its logarithm, then 0.
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    fn default_phi(&self, scale: f64) -> Vec<f64> {
        let mut phi = vec![0.0; self.parameters()];
        phi[0] = ln_scale(scale);
        phi
    }

    /// Number of leading parameters that are logarithms, first that of the scale or of a multiple of it; 0 for a softness without a scale.
    /// Provided: 1.
    fn logarithms(&self) -> usize {
        1
    }

    /// The scale of these parameters, in the unit of x. Provided: `exp(phi[0])`.
    fn scale(&self, phi: &[f64]) -> f64 {
        phi[0].exp()
    }

    /// Whether the scale is in the square of the unit of `x`, as in a step of `x |x|`. Provided: no.
    fn scale_is_squared(&self) -> bool {
        false
    }

    /// Width of the step, in the unit of `x`. Provided: the scale, or its square root if it [is squared](Softness::scale_is_squared). If
    /// only [`with_scale`](Softness::with_scale) changes the parameters, the step is stretched along `x` in proportion to the width.
    fn width(&self, phi: &[f64]) -> f64 {
        if self.scale_is_squared() { self.scale(phi).sqrt() } else { self.scale(phi) }
    }

    /// Parameters of an otherwise equal step whose scale is `factor` `[1]` times that of `phi`. Provided: the logarithm of the factor is
    /// added to the first.
    fn with_scale<B: Backend>(&self, phi: Tensor<B, 1>, factor: Tensor<B, 1>) -> Tensor<B, 1> {
        let first = phi.clone().narrow(0, 0, 1) + factor.log();
        with_first(first, phi)
    }

    /// Parameters, as numbers, of the step stretched by `factor`: what [`with_scale`](Softness::with_scale) computes on tensors. Override both alike.
    fn with_scale_values(&self, phi: &[f64], factor: f64) -> Vec<f64> {
        let mut phi = phi.to_vec();
        phi[0] += factor.ln();
        phi
    }
}

/// A method of [`Softness`] on distances: the trait's signature, with this body; in brackets, a method that returns several tensors.
macro_rules! curve {
    ($self:ident.$method:ident($phi:ident, $x:ident) => $body:expr) => {
        fn $method<B: Backend, const D: usize>(
            &$self,
            $phi: Tensor<B, 1>,
            $x: Tensor<B, D>,
        ) -> Tensor<B, D> {
            $body
        }
    };
    ([$self:ident.$method:ident($phi:ident, $x:ident); $count:literal] => $body:expr) => {
        fn $method<B: Backend, const D: usize>(
            &$self,
            $phi: Tensor<B, 1>,
            $x: Tensor<B, D>,
        ) -> [Tensor<B, D>; $count] {
            $body
        }
    };
}
pub(crate) use curve;

/// Parameters and scale of a [`Softness`]: those of the softness in this field.
macro_rules! forward {
    ($inner:tt) => {
        fn parameters(&self) -> usize {
            self.$inner.parameters()
        }

        fn default_phi(&self, scale: f64) -> Vec<f64> {
            self.$inner.default_phi(scale)
        }

        fn logarithms(&self) -> usize {
            self.$inner.logarithms()
        }

        fn scale(&self, phi: &[f64]) -> f64 {
            self.$inner.scale(phi)
        }

        fn with_scale<B: Backend>(&self, phi: Tensor<B, 1>, factor: Tensor<B, 1>) -> Tensor<B, 1> {
            self.$inner.with_scale(phi, factor)
        }

        fn with_scale_values(&self, phi: &[f64], factor: f64) -> Vec<f64> {
            self.$inner.with_scale_values(phi, factor)
        }
    };
}
pub(crate) use forward;

/// The derivative of every entry of `of(x)` with respect to its own `x`, at an inner level of autodiff; ops on `B` are still tracked by the
/// levels of `B`.
fn slope<B: Backend, const D: usize>(
    x: Tensor<B, D>,
    of: impl FnOnce(Tensor<Autodiff<B>, D>) -> Tensor<Autodiff<B>, D>,
) -> Tensor<B, D> {
    let x = Tensor::<Autodiff<B>, D>::from_inner(x).require_grad();
    let gradients = of(x.clone()).sum().backward();
    x.grad(&gradients).unwrap_or_else(|| x.inner().zeros_like())
}
