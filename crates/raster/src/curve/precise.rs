//! Numbers in the most precise float type of a device.

use softrast_tensor::{Backend, DType, Tensor, TensorData};

/// A tensor in the most precise float type of a device.
pub(crate) fn precise<B: Backend>(values: &[f64], device: &B::Device) -> Tensor<B, 1> {
    let data = TensorData::new(values.to_vec(), [values.len()]);
    Tensor::from_data(data, (device, finest::<B>(device)))
}

fn finest<B: Backend>(device: &B::Device) -> DType {
    if B::supports_dtype(device, DType::F64) { DType::F64 } else { DType::F32 }
}

/// Relative rounding of a value in this type.
pub(crate) fn rounding<B: Backend>(device: &B::Device) -> f64 {
    if finest::<B>(device) == DType::F64 { 1e-14 } else { 1e-6 }
}
