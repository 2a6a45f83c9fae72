//! Tensors of plain numbers.

use burn::tensor::{Element, Tensor, TensorData, backend::Backend};

/// A tensor in the float type of its backend, whatever type the device defaults to.
///
/// # Panics
///
/// If the number of values is not that of the shape.
pub fn tensor<B: Backend, const D: usize>(values: Vec<f64>, shape: [usize; D]) -> Tensor<B, D> {
    let dtype = <B::FloatElem as Element>::dtype();
    Tensor::from_data(TensorData::new(values, shape), (&Default::default(), dtype))
}

/// A vector in the float type of its backend.
pub fn vector<B: Backend>(values: &[f64]) -> Tensor<B, 1> {
    tensor(values.to_vec(), [values.len()])
}

/// Numbers of a tensor, row by row.
pub fn numbers<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

/// Euclidean norm, summed in f64.
pub(crate) fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}
