use burn::tensor::{Tensor, backend::Backend};

/// Keeps the ratio of two empty images defined.
const EMPTY: f64 = 1e-6;

/// `1 - |p ∩ t| / |p ∪ t|` of each view, soft: `1 - Σ p t / (Σ (p + t - p t) + 1e-6)`.
///
/// `image` and `target` are `[views, height, width]` in [0, 1]; the result is `[views]`. Two empty
/// images give 1, as an empty one against any other does: such a target cannot be matched.
///
/// Source: docs/notes.md, Losses and errors.
pub fn iou_loss<B: Backend>(image: Tensor<B, 3>, target: Tensor<B, 3>) -> Tensor<B, 1> {
    let [views, height, width] = image.dims();
    let sum =
        |pixels: Tensor<B, 3>| pixels.reshape([views, height * width]).sum_dim(1).reshape([views]);
    let overlap = image.clone() * target.clone();
    let union = sum(image + target - overlap.clone());
    (sum(overlap) / (union + EMPTY)).neg() + 1.0
}

/// Mean squared difference of each view: `[views, height, width]` to `[views]`.
pub fn mse_loss<B: Backend>(image: Tensor<B, 3>, target: Tensor<B, 3>) -> Tensor<B, 1> {
    let [views, height, width] = image.dims();
    let difference = image - target;
    (difference.clone() * difference).reshape([views, height * width]).mean_dim(1).reshape([views])
}
