use softrast_tensor::{Backend, Tensor};

/// A tensor in the float type of its backend, not that of the device.
///
/// # Panics
///
/// If the number of values does not match the shape.
pub fn tensor<B: Backend, const D: usize>(values: &[f64], shape: [usize; D]) -> Tensor<B, D> {
    softrast_tensor::tensor(values.to_vec(), shape)
}
