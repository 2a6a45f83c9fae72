use burn::tensor::{Tensor, backend::Backend};

/// Below this argument the series serves; its first term left out is then 7e-22.
const SMALL: f64 = 3e-3;

/// `atan(w) / w` for `0 <= w <= 1`, with `1` at 0.
pub(crate) fn atan_ratio<B: Backend, const D: usize>(w: Tensor<B, D>) -> Tensor<B, D> {
    let small = w.clone().lower_elem(SMALL);
    let w2 = w.clone() * w.clone();
    let series = ((w2.clone() * (-1.0 / 7.0) + 0.2) * w2.clone() - 1.0 / 3.0) * w2 + 1.0;
    let w = w.mask_fill(small.clone(), 1.0);
    (w.clone().atan() / w).mask_where(small, series)
}
