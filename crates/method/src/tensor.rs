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

/// Numbers of a tensor, row by row.
pub fn numbers<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}
