//! Tensors of numbers, in the float type of their backend, not that of the device.

use crate::{Backend, Element, Tensor, TensorData};

/// A tensor of `values`, in row-major order.
///
/// # Panics
///
/// If the number of values does not match the shape.
pub fn tensor<B: Backend, const D: usize>(values: Vec<f64>, shape: [usize; D]) -> Tensor<B, D> {
    tensor_on(values, shape, &Default::default())
}

/// A [`tensor`] on a device.
///
/// # Panics
///
/// If the number of values does not match the shape.
pub fn tensor_on<B: Backend, const D: usize>(
    values: Vec<f64>,
    shape: [usize; D],
    device: &B::Device,
) -> Tensor<B, D> {
    let dtype = <B::FloatElem as Element>::dtype();
    Tensor::from_data(TensorData::new(values, shape), (device, dtype))
}

/// A [`tensor`] with one axis.
pub fn vector<B: Backend>(values: &[f64]) -> Tensor<B, 1> {
    tensor(values.to_vec(), [values.len()])
}

/// Numbers of a tensor, in row-major order.
pub fn numbers<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}
