//! Functions of arrays that lie on a device, in float32.

use std::{marker::PhantomData, sync::Arc};

use softrast_raster::{
    RasterBackend,
    low_level::{FusedOp, Pass},
};
use softrast_tensor::{DType, NdArray, Tensor, TensorData, TensorMetadata as _, TensorPrimitive};

use crate::{
    arrays::{Array, Floats},
    dlpack::Lent,
    kind::{Call, Kind},
    store::Store,
    taped::Taped,
};

/// A backend whose devices share their memory with other libraries.
pub(crate) trait Device: RasterBackend {
    /// Tensors with the numbers of arrays, all in float32 on one device of this backend.
    fn import(arrays: &[&Lent<'_>]) -> Result<Vec<Tensor<Self, 1>>, String>;

    /// Writes tensors to arrays of as many numbers, all in float32 on their device.
    fn export(tensors: Vec<Tensor<Self, 1>>, arrays: &[&Lent<'_>]) -> Result<(), String>;
}

/// Calls a function of arrays that lie on a device, and writes the results to arrays there. φ and what follows it is in float64, on the CPU.
pub(crate) fn call<B: Device>(
    kind: &Kind,
    call: &Call<'_>,
    inputs: &[Lent<'_>],
    outputs: &[Lent<'_>],
) -> Result<(), String> {
    let device = inputs.first().ok_or("a function has inputs")?.device;
    let mut others = inputs.iter().chain(outputs).filter(|array| !array.wide);
    if others.any(|array| array.device != device) {
        return Err("the arrays of a call must lie on one device".to_owned());
    }
    let narrow: Vec<_> = inputs.iter().filter(|array| !array.wide).collect();
    let mut tensors = B::import(&narrow)?.into_iter();
    let array = |array: &Lent<'_>| {
        let numbers = if array.wide {
            Floats::F64(array.numbers::<f64>().ok_or(WIDE)?.to_vec().into())
        } else {
            On::<B>::floats(tensors.next().ok_or("an array is missing")?)
        };
        Ok::<_, String>(Array { dims: array.dims.clone(), numbers })
    };
    let arrays = inputs.iter().map(array).collect::<Result<Vec<_>, _>>()?;
    let found = kind.call::<On<B>>(call, &arrays)?;
    if !found.iter().map(|array| &array.dims).eq(outputs.iter().map(|array| &array.dims)) {
        return Err("the results of a call have other shapes".to_owned());
    }
    let (mut results, mut places) = (Vec::new(), Vec::new());
    for (array, output) in found.iter().zip(outputs) {
        match &array.numbers {
            Floats::F64(values) if output.write(values) => {}
            numbers => {
                let tensor = On::<B>::known(numbers).filter(|_| !output.wide).ok_or(WIDE)?;
                results.push(tensor.clone());
                places.push(output);
            }
        }
    }
    B::export(results, &places)
}

const WIDE: &str = "arrays on a device must be float32: convert them with float()";

/// Flat tensors of a backend in float32.
#[derive(Clone)]
pub(crate) struct On<B>(PhantomData<B>);

impl<B: RasterBackend> Store for On<B> {
    type Slice = Tensor<B, 1>;
    type Owned = Tensor<B, 1>;
    const ON_HOST: bool = false;

    fn known<'a>(floats: &'a Floats<'_>) -> Option<&'a Tensor<B, 1>> {
        if let Floats::Device(tensor) = floats { tensor.downcast_ref() } else { None }
    }

    fn floats(values: Tensor<B, 1>) -> Floats<'static> {
        Floats::Device(Arc::new(values))
    }

    fn count(values: &Tensor<B, 1>) -> usize {
        values.dims()[0]
    }

    fn wide(values: &Tensor<B, 1>) -> Vec<f64> {
        values.to_data().iter().collect()
    }

    fn narrow(values: &[f64], beside: &Tensor<B, 1>) -> Tensor<B, 1> {
        let values: Vec<f32> = values.iter().map(|&x| x as f32).collect();
        let shape = [values.len()];
        Tensor::from_data(TensorData::new(values, shape), (&beside.device(), DType::F32))
    }

    fn filled(value: f64, count: usize, beside: &Tensor<B, 1>) -> Tensor<B, 1> {
        Tensor::full([count], value, (&beside.device(), DType::F32))
    }

    fn sum(a: Tensor<B, 1>, b: &Tensor<B, 1>) -> Tensor<B, 1> {
        a + b.clone()
    }

    fn scaled(values: &Tensor<B, 1>, factors: &Tensor<B, 1>) -> Tensor<B, 1> {
        let ([count], [parts]) = (values.dims(), factors.dims());
        let values = values.clone().reshape([parts, count / parts]);
        (values * factors.clone().reshape([parts, 1])).reshape([count])
    }

    fn concatenated(parts: &[&Tensor<B, 1>]) -> Tensor<B, 1> {
        Tensor::cat(parts.iter().copied().cloned().collect(), 0)
    }

    fn split(values: Tensor<B, 1>, counts: &[usize]) -> Vec<Tensor<B, 1>> {
        values.split_with_sizes(counts.to_vec(), 0)
    }

    fn finite(values: &Tensor<B, 1>) -> bool {
        values.clone().is_finite().all().into_data().iter::<bool>().all(|finite| finite)
    }

    fn same(_: &Tensor<B, 1>, _: &Tensor<B, 1>) -> bool {
        false
    }

    fn run(
        op: &FusedOp,
        pass: &Pass,
        inputs: &[&Tensor<B, 1>],
        dims: &[Vec<usize>],
    ) -> Tensor<B, 1> {
        let primitive = |tensor: &&Tensor<B, 1>| (*tensor).clone().into_primitive().tensor();
        let mut tensors: Vec<_> = inputs.iter().map(primitive).collect();
        for (tensor, dims) in tensors.iter_mut().zip(dims) {
            *tensor = B::float_reshape(tensor.clone(), dims.clone().into());
        }
        let found = B::run(op, pass, tensors);
        let count = found.shape().num_elements();
        Tensor::from_primitive(TensorPrimitive::Float(B::float_reshape(found, [count].into())))
    }

    fn run_taped(of: &Taped, pass: &Pass, inputs: &[&Tensor<B, 1>]) -> Tensor<B, 1> {
        of.run(pass, inputs.iter().copied().cloned().collect())
    }
}

/// The CPU as a device, with which everything except CUDA itself is tested.
impl Device for NdArray<f32> {
    fn import(arrays: &[&Lent<'_>]) -> Result<Vec<Tensor<Self, 1>>, String> {
        let tensor = |array: &&Lent<'_>| {
            let values = array.numbers::<f32>()?.to_vec();
            let data = TensorData::new(values, [array.count()]);
            Some(Tensor::from_data(data, (&Default::default(), DType::F32)))
        };
        arrays.iter().map(tensor).collect::<Option<_>>().ok_or_else(|| WIDE.to_owned())
    }

    fn export(tensors: Vec<Tensor<Self, 1>>, arrays: &[&Lent<'_>]) -> Result<(), String> {
        for (tensor, array) in tensors.into_iter().zip(arrays) {
            let values =
                tensor.into_data().into_vec::<f32>().map_err(|error| format!("{error:?}"))?;
            if !array.write(&values) {
                return Err("a result does not fit its array".to_owned());
            }
        }
        Ok(())
    }
}
