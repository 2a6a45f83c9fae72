use softrast_tensor::{Backend, Tensor};

use crate::math::polynomial;

/// `erfcx(a) / t` in powers of `2 t - 1`, with `t = 1 / (1 + a / 2)`.
///
/// A Chebyshev series over `t` in [0, 1], fitted with 50 digits and cut where its terms fall below
/// 2e-17; in f64 its relative error is 2e-16.
#[rustfmt::skip]
const SCALED_COMPLEMENT: [f64; 27] = [
    0.5107913526210115, 0.34358034220690514, 0.13973604627802688, 0.01822111575345904,
    -0.010755330944716365, -0.0032395925345820673, 0.0015453060290576436, 0.0004186480432791111,
    -0.00033153674761946043, -1.7185831874889752e-05, 7.223535061438543e-05,
    -1.7073781133818914e-05, -1.0848057268891096e-05, 8.05787586714734e-06,
    -5.628166935192924e-07, -1.8150355080541665e-06, 1.00091858626541e-06,
    -1.3754508233185945e-08, -2.855481823834117e-07, 1.7867229479168533e-07,
    -1.6982724012935667e-09, -6.965842943409138e-08, 2.9041985444209086e-08,
    1.3216325517632649e-08, -9.744756625932259e-09, -1.05903331435718e-09, 1.2051665995883637e-09,
];

/// `erf(w) / w` in powers of `2 w² - 1`, for `w` in [0, 1]; fitted like [`SCALED_COMPLEMENT`].
#[rustfmt::skip]
const RATIO: [f64; 12] = [
    0.9654687386698673, -0.1405360890227171, 0.019852496688984218, -0.0022854855611441132,
    0.00021751715603563404, -1.7537169441124826e-05, 1.2233827638116999e-06,
    -7.51156928660089e-08, 4.115751497588646e-09, -2.035228404899467e-10, 9.211251258348265e-12,
    -3.8078827395263415e-13,
];

/// `t` and `erfcx(a) / t` of [`SCALED_COMPLEMENT`]; the second lies between 0.28 and 1.
fn factors<B: Backend, const D: usize>(a: Tensor<B, D>) -> (Tensor<B, D>, Tensor<B, D>) {
    let t = (a * 0.5 + 1.0).recip();
    (t.clone(), polynomial(&SCALED_COMPLEMENT, t * 2.0 - 1.0))
}

/// `exp(a²) erfc(a)` for `a >= 0`, which does not underflow.
///
/// Not `1 - erf(a)`: burn has no complement, and the difference loses all digits beyond 6.
pub(crate) fn erfcx<B: Backend, const D: usize>(a: Tensor<B, D>) -> Tensor<B, D> {
    let (t, rest) = factors(a);
    t * rest
}

/// `1 / (exp(a²) erfc(a))` for `a >= 0`.
///
/// Not the reciprocal of [`erfcx`], whose derivative leaves the range of f32 far out.
pub(crate) fn per_erfcx<B: Backend, const D: usize>(a: Tensor<B, D>) -> Tensor<B, D> {
    let (_, rest) = factors(a.clone());
    (a * 0.5 + 1.0) / rest
}

/// `ln(exp(a²) erfc(a))` for `a >= 0`.
pub(crate) fn ln_erfcx<B: Backend, const D: usize>(a: Tensor<B, D>) -> Tensor<B, D> {
    let (_, rest) = factors(a.clone());
    rest.log() - (a * 0.5).log1p()
}

/// `erfc(a)` for `a >= 0`, exact in the tail until it underflows.
pub(crate) fn erfc<B: Backend, const D: usize>(a: Tensor<B, D>) -> Tensor<B, D> {
    (a.clone() * a.clone()).neg().exp() * erfcx(a)
}

/// `erf(a)` for `a >= 0`, exact also near 0.
pub(crate) fn erf<B: Backend, const D: usize>(a: Tensor<B, D>) -> Tensor<B, D> {
    let near = a.clone().clamp_max(1.0);
    let series = near.clone() * polynomial(&RATIO, near.clone() * near * 2.0 - 1.0);
    let far = a.clone().greater_elem(1.0);
    series.mask_where(far, erfc(a).neg() + 1.0)
}
