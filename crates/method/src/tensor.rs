use burn::tensor::{Element, Tensor, TensorData, Transaction, backend::Backend};
use softrast_raster::HostBackend;

/// A tensor in the float type of its backend, whatever type the device defaults to.
///
/// # Panics
///
/// If the number of values is not that of the shape.
pub fn tensor<B: Backend, const D: usize>(values: Vec<f64>, shape: [usize; D]) -> Tensor<B, D> {
    let dtype = <B::FloatElem as Element>::dtype();
    Tensor::from_data(TensorData::new(values, shape), (&Default::default(), dtype))
}

/// What was read of a device as a tensor on the CPU, in the same float type.
///
/// # Panics
///
/// If it has not `D` dimensions.
pub fn on_host<const D: usize>(data: TensorData) -> Tensor<HostBackend, D> {
    let dtype = data.dtype;
    Tensor::from_data(data, (&Default::default(), dtype))
}

/// Reads the `N` tensors of a transaction, and perhaps one more, in one round trip to their device.
///
/// # Panics
///
/// If there are fewer.
pub fn read<B: Backend, const N: usize>(
    transaction: Transaction<B>,
) -> ([TensorData; N], Option<TensorData>) {
    let mut read = transaction.execute().into_iter();
    let first = [(); N].map(|()| read.next().expect("as many tensors as were registered"));
    (first, read.next())
}

/// Numbers of a tensor, row by row.
pub fn numbers<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}
