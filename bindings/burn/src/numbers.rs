//! Conversion of numbers between both releases of burn.

use burn::tensor::TensorData;
use softrast::{
    raster::RasterBackend,
    tensor::{self as inner, Tensor},
};

/// A float type of both releases.
pub(crate) trait Number: burn::tensor::Element + inner::Element {}
impl Number for f32 {}
impl Number for f64 {}

pub(crate) fn import<B: RasterBackend, F: Number, const D: usize>(
    data: TensorData,
) -> Tensor<B, D> {
    let shape = data.shape().to_vec();
    let values = data.try_into_vec::<F>().expect("all tensors of an op have one float type");
    let data = inner::TensorData::new(values, shape);
    Tensor::from_data(data, (&Default::default(), <F as inner::Element>::dtype()))
}

pub(crate) fn export<B: RasterBackend, F: Number, const D: usize>(
    tensor: Tensor<B, D>,
) -> TensorData {
    let dims = tensor.dims();
    let values = tensor.into_data().into_vec::<F>();
    TensorData::new(values.expect("an op keeps the float type of its inputs"), dims)
}
