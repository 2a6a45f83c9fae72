use softrast_tensor::{Backend, Tensor};

/// Light transmitted by a face that the formula makes fully opaque.
///
/// Steps that end, such as reversed laws, reach `s = 1` exactly, where the optical depth `-ln(1 - s)` is infinite. For them it is
/// `-ln(OPAQUE + (1 - OPAQUE)(1 - s))`: at most `-ln(OPAQUE)` = 16.1, and no silhouette changes by more than `OPAQUE`.
pub const OPAQUE: f64 = 1e-7;

/// The largest distance, in scales, that a softness distinguishes from infinity.
///
/// Larger distances are clamped to it: its square still fits an f32, and the slowest tail (Levy) is within 3e-8 of its limit.
pub(crate) const FAR: f64 = 1e15;

/// Entry `k` of `phi`, shaped `[1; D]` so that it broadcasts over distances.
pub(crate) fn parameter<B: Backend, const D: usize>(phi: &Tensor<B, 1>, k: usize) -> Tensor<B, D> {
    phi.clone().narrow(0, k, 1).reshape([1; D])
}

/// One over the scale, whose logarithm is the first entry of `phi`.
///
/// The exponential of the negated logarithm: dividing by the scale would square it in the backward
/// pass, which leaves the range of f32 for small scales.
pub(crate) fn per_scale<B: Backend, const D: usize>(phi: &Tensor<B, 1>) -> Tensor<B, D> {
    parameter(phi, 0).neg().exp()
}

/// The distance `x` in units of the scale, within ±[`FAR`].
pub(crate) fn in_scales<B: Backend, const D: usize>(
    phi: &Tensor<B, 1>,
    x: Tensor<B, D>,
) -> Tensor<B, D> {
    (x * per_scale(phi)).clamp(-FAR, FAR)
}

/// `|u|`, with derivative 1 at 0.
///
/// `Tensor::abs` has derivative 0 there, so that a formula in `|u|` for positive `u` would have a wrong derivative at 0.
pub(crate) fn magnitude<B: Backend, const D: usize>(u: Tensor<B, D>) -> Tensor<B, D> {
    let below = u.clone().lower_elem(0.0);
    u.clone().mask_where(below, u.neg())
}

/// `-ln(open)` where `covered + open = 1`, computed from the smaller of the two.
///
/// `open` must be positive wherever `covered >= 1/2`.
pub(crate) fn optical_depth_of<B: Backend, const D: usize>(
    covered: Tensor<B, D>,
    open: Tensor<B, D>,
) -> Tensor<B, D> {
    let dense = covered.clone().greater_equal_elem(0.5);
    let thin = covered.mask_fill(dense.clone(), 0.0).neg().log1p().neg();
    let thick = open.mask_fill(dense.clone().bool_not(), 1.0).log().neg();
    thin.mask_where(dense, thick)
}

/// The optical depth of a softness that reaches 1: `-ln(OPAQUE + (1 - OPAQUE) open)`.
///
/// `covered` and `open` add up to 1, and each is computed without cancellation; see [`OPAQUE`].
pub(crate) fn bounded_depth<B: Backend, const D: usize>(
    covered: Tensor<B, D>,
    open: Tensor<B, D>,
) -> Tensor<B, D> {
    optical_depth_of(covered * (1.0 - OPAQUE), open * (1.0 - OPAQUE) + OPAQUE)
}

/// The derivative of [`bounded_depth`] where `density` is that of `covered`.
pub(crate) fn bounded_hazard<B: Backend, const D: usize>(
    density: Tensor<B, D>,
    open: Tensor<B, D>,
) -> Tensor<B, D> {
    density * (1.0 - OPAQUE) / (open * (1.0 - OPAQUE) + OPAQUE)
}

/// From here on the direct difference keeps the digits of [`rise`], and those of its derivative.
const PLAIN_FROM: f64 = 1.0;

/// `1 - exp(-v)` for `v >= 0`, exact also near 0, with a derivative exact in the tail.
///
/// Near 0 computed from `tanh(v / 2)`, as burn has no expm1.
pub(crate) fn rise<B: Backend, const D: usize>(v: Tensor<B, D>) -> Tensor<B, D> {
    let plain = v.clone().greater_elem(PLAIN_FROM);
    let t = (v.clone().clamp_max(PLAIN_FROM) * 0.5).tanh();
    (t.clone() * 2.0 / (t + 1.0)).mask_where(plain, v.neg().exp().neg() + 1.0)
}

/// `Σ coefficients[k] x^k` by Horner's rule.
pub(crate) fn polynomial<B: Backend, const D: usize>(
    coefficients: &[f64],
    x: Tensor<B, D>,
) -> Tensor<B, D> {
    let (last, rest) = coefficients.split_last().expect("a polynomial has a coefficient");
    let highest = x.zeros_like() + *last;
    rest.iter().rev().fold(highest, |sum, &coefficient| sum * x.clone() + coefficient)
}

/// Below this argument the series is used; its first omitted term is then 7e-22.
const SERIES_BELOW: f64 = 3e-3;

/// `atan(w) / w` for `0 <= w <= 1`, with `1` at 0.
pub(crate) fn atan_ratio<B: Backend, const D: usize>(w: Tensor<B, D>) -> Tensor<B, D> {
    let small = w.clone().lower_elem(SERIES_BELOW);
    let w2 = w.clone() * w.clone();
    let series = ((w2.clone() * (-1.0 / 7.0) + 0.2) * w2.clone() - 1.0 / 3.0) * w2 + 1.0;
    let w = w.mask_fill(small.clone(), 1.0);
    (w.clone().atan() / w).mask_where(small, series)
}

/// Shift of the argument before the asymptotic series is used.
const ASCENT: usize = 10;

/// `B₂ₖ / (2k (2k - 1))` for k = 1, 2, …: at 10 and above, the omitted terms are below 3e-17.
const STIRLING: [f64; 7] = [
    1.0 / 12.0,
    -1.0 / 360.0,
    1.0 / 1260.0,
    -1.0 / 1680.0,
    1.0 / 1188.0,
    -691.0 / 360_360.0,
    1.0 / 156.0,
];

/// `ln Γ(p)` for `p > 0`, differentiable any number of times.
///
/// Stirling's series at `p + 10`, reduced by `Γ(p + 1) = p Γ(p)`.
pub(crate) fn ln_gamma<B: Backend, const D: usize>(p: Tensor<B, D>) -> Tensor<B, D> {
    let ascent = (1..ASCENT).fold(p.clone(), |product, k| product * (p.clone() + k as f64));
    let top = p + ASCENT as f64;
    let per_top = top.clone().recip();
    let series = per_top.clone() * polynomial(&STIRLING, per_top.clone() * per_top);
    let half_ln_tau = 0.5 * std::f64::consts::TAU.ln();
    (top.clone() - 0.5) * top.clone().log() - top + half_ln_tau + series - ascent.log()
}

/// The logarithm of a scale.
///
/// # Panics
///
/// If `scale` is not positive.
pub fn ln_scale(scale: f64) -> f64 {
    assert!(scale > 0.0 && scale.is_finite(), "scale {scale} is not positive");
    scale.ln()
}

/// `phi` with its leading entries replaced by `first`.
pub(crate) fn with_first<B: Backend>(first: Tensor<B, 1>, phi: Tensor<B, 1>) -> Tensor<B, 1> {
    let ([replaced], [count]) = (first.dims(), phi.dims());
    if count == replaced {
        return first;
    }
    Tensor::cat(vec![first, phi.narrow(0, replaced, count - replaced)], 0)
}
