use softrast_tensor::Tensor;

use crate::RasterBackend;

/// The products of matrices `[views, rows, inner]` and `[views or 1, inner, columns]` with a small `inner`.
///
/// A GPU sums products of columns and rows. burn's product of large matrices is no faster here, and requires adapter features that a
/// browser may not have.
pub fn small_product<B: RasterBackend>(a: Tensor<B, 3>, b: Tensor<B, 3>) -> Tensor<B, 3> {
    if B::ON_HOST {
        return a.matmul(b);
    }
    let [_, _, inner] = a.dims();
    let part = |k: usize| a.clone().narrow(2, k, 1) * b.clone().narrow(1, k, 1);
    (1..inner).fold(part(0), |sum, k| sum + part(k))
}
