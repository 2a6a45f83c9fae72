use burn::tensor::{Element, Tensor, TensorData, backend::Backend};

/// A tensor in the float type of its backend, whatever type the device defaults to.
///
/// # Panics
///
/// If the number of values is not that of the shape.
pub fn tensor<B: Backend, const D: usize>(values: &[f64], shape: [usize; D]) -> Tensor<B, D> {
    let dtype = <B::FloatElem as Element>::dtype();
    Tensor::from_data(TensorData::new(values.to_vec(), shape), (&Default::default(), dtype))
}

/// A [`tensor`] with one axis.
pub fn vector<B: Backend>(values: &[f64]) -> Tensor<B, 1> {
    tensor(values, [values.len()])
}

/// Numbers of a tensor, row by row.
pub fn numbers<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}
