//! Tensors of plain numbers, in the float type of their backend whatever type the device defaults to.

use crate::{Backend, Element, Tensor, TensorData};

/// A tensor of these values, row by row.
///
/// # Panics
///
/// If the number of values is not that of the shape.
pub fn tensor<B: Backend, const D: usize>(values: Vec<f64>, shape: [usize; D]) -> Tensor<B, D> {
    tensor_on(values, shape, &Default::default())
}

/// The same on a device.
///
/// # Panics
///
/// If the number of values is not that of the shape.
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

/// Numbers of a tensor, row by row.
pub fn numbers<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}
