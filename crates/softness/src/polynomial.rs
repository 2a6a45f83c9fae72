use burn::tensor::{Tensor, backend::Backend};

/// `Σ coefficients[k] x^k` by Horner's rule.
pub(crate) fn polynomial<B: Backend, const D: usize>(
    coefficients: &[f64],
    x: Tensor<B, D>,
) -> Tensor<B, D> {
    let (last, rest) = coefficients.split_last().expect("a polynomial has a coefficient");
    let highest = x.zeros_like() + *last;
    rest.iter().rev().fold(highest, |sum, &coefficient| sum * x.clone() + coefficient)
}
