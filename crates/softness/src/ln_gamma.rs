use burn::tensor::{Tensor, backend::Backend};

use crate::polynomial::polynomial;

/// How far the argument is moved up before the asymptotic series is used.
const RISE: usize = 10;

/// `B₂ₖ / (2k (2k - 1))` for k = 1, 2, …: at 10 and above, what is left out is below 3e-17.
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
/// Stirling's series at `p + 10`, brought back with `Γ(p + 1) = p Γ(p)`.
pub(crate) fn ln_gamma<B: Backend, const D: usize>(p: Tensor<B, D>) -> Tensor<B, D> {
    let ascent = (1..RISE).fold(p.clone(), |product, k| product * (p.clone() + k as f64));
    let top = p + RISE as f64;
    let per_top = top.clone().recip();
    let series = per_top.clone() * polynomial(&STIRLING, per_top.clone() * per_top);
    let half_ln_tau = 0.5 * std::f64::consts::TAU.ln();
    (top.clone() - 0.5) * top.clone().log() - top + half_ln_tau + series - ascent.log()
}
