//! Vectors between burn and plain numbers.

use burn::tensor::{Element, Tensor, TensorData, backend::Backend};

/// A tensor in the float type of its backend, whatever type the device defaults to.
pub(crate) fn tensor<B: Backend>(values: &[f64]) -> Tensor<B, 1> {
    let dtype = <B::FloatElem as Element>::dtype();
    let data = TensorData::new(values.to_vec(), [values.len()]);
    Tensor::from_data(data, (&Default::default(), dtype))
}

pub(crate) fn numbers<B: Backend>(tensor: Tensor<B, 1>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

/// Euclidean norm, summed in f64.
pub(crate) fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}
