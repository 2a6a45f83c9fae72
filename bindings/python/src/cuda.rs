//! CUDA devices: numbers move between the memory of other libraries and that of the kernels by copies on the device.
//!
//! The kernels run on streams of their own, which no other library knows. So the order of things is this:
//!
//! - The other library orders its work before the legacy default stream: `__dlpack__(stream=1)` of an input or of an output, whose memory may
//!   have been in use before.
//! - Copies run on that stream, and both `import` and `export` wait for theirs.
//! - Before a copy, the host waits for the stream of the kernels: memory that they get may still be in use by earlier kernels, and what they
//!   return must be computed.
//!
//! Nothing is in flight when a call returns, so whatever stream goes on with the results has them.

use softrast_raster::{Cuda, cuda_device_name};
use softrast_tensor::{
    Backend as _, DType, Tensor, TensorPrimitive,
    cuda::{CudaDevice, CudaRuntime},
    gpu::{
        CubeTensor,
        cubecl::{Runtime as _, server::Handle},
        into_contiguous,
    },
};

use cudarc::driver::{
    result::{ctx, device, memcpy_dtod_async, primary_ctx, stream},
    sys::{CUcontext, CUdevice, CUstream},
};

use crate::{device::Device, dlpack::Lent};

/// The legacy default stream, as the driver calls it.
const LEGACY: CUstream = std::ptr::without_provenance_mut(1);

impl Device for Cuda {
    fn import(arrays: &[&Lent<'_>]) -> Result<Vec<Tensor<Self, 1>>, String> {
        cuda_device_name().map_err(|error| error.to_string())?;
        let Some(first) = arrays.first() else { return Ok(Vec::new()) };
        let current = Current::new(first.device[1])?;
        let client = CudaRuntime::client(&current.own);
        let empty = |array: &&Lent<'_>| client.empty(array.count() * size_of::<f32>());
        let buffers: Vec<Handle> = arrays.iter().map(empty).collect();
        current.copies(&buffers, arrays, Way::In)?;
        let tensors = buffers.into_iter().zip(arrays).map(|(buffer, array)| {
            let shape = [array.count()].into();
            let (client, own) = (client.clone(), current.own.clone());
            CubeTensor::new_contiguous(client, own, shape, buffer, DType::F32)
        });
        Ok(tensors.map(|tensor| Tensor::from_primitive(TensorPrimitive::Float(tensor))).collect())
    }

    fn export(tensors: Vec<Tensor<Self, 1>>, arrays: &[&Lent<'_>]) -> Result<(), String> {
        let Some(first) = arrays.first() else { return Ok(()) };
        let current = Current::new(first.device[1])?;
        let buffer =
            |tensor: Tensor<Self, 1>| into_contiguous(tensor.into_primitive().tensor()).handle;
        let buffers: Vec<Handle> = tensors.into_iter().map(buffer).collect();
        current.copies(&buffers, arrays, Way::Out)
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Way {
    In,
    Out,
}

/// The primary context of a device, which all libraries of a process share, as the current one of this thread.
struct Current {
    own: CudaDevice,
    device: CUdevice,
    before: CUcontext,
}

impl Current {
    fn new(index: i32) -> Result<Self, String> {
        let enter = || {
            let device = device::get(index)?;
            let before = ctx::get_current()?.unwrap_or(std::ptr::null_mut());
            // SAFETY: the device is one of the driver's.
            let context = unsafe { primary_ctx::retain(device)? };
            let own = CudaDevice::new(index as usize);
            let current = Self { own, device, before };
            // SAFETY: the context is retained until it is no longer current.
            unsafe { ctx::set_current(context)? };
            Ok(current)
        };
        enter().map_err(failed)
    }

    /// Copies between buffers of the kernels and arrays of as many numbers, and waits until they are done.
    fn copies(&self, buffers: &[Handle], arrays: &[&Lent<'_>], way: Way) -> Result<(), String> {
        let client = CudaRuntime::client(&self.own);
        let resource = |buffer: &Handle| client.get_resource(buffer.clone());
        let resources = buffers.iter().map(resource).collect::<Result<Vec<_>, _>>();
        let resources = resources.map_err(|error| error.to_string())?;
        let mut sizes = resources.iter().map(|resource| resource.resource().size).zip(arrays);
        if sizes.any(|(size, array)| size < (array.count() * size_of::<f32>()) as u64) {
            return Err("a buffer of the kernels is smaller than its array".to_owned());
        }
        Cuda::sync(&self.own).map_err(|error| error.to_string())?;
        let mut done = Ok(());
        for (resource, array) in resources.iter().zip(arrays) {
            let (inner, outer) = (resource.resource(), array.address as u64);
            let bytes = array.count() * size_of::<f32>();
            let [to, from] = if way == Way::In { [inner.ptr, outer] } else { [outer, inner.ptr] };
            // SAFETY: both have as many bytes on this device, and live until the stream has been waited for.
            done = done.and_then(|()| unsafe { memcpy_dtod_async(to, from, bytes, LEGACY) });
        }
        // SAFETY: the stream is that of the current context.
        done.and(unsafe { stream::synchronize(LEGACY) }).map_err(failed)
    }
}

impl Drop for Current {
    fn drop(&mut self) {
        // SAFETY: the context is the one that was current before; the other one was retained by `new`. An error leaves nothing to do.
        let _ = unsafe { ctx::set_current(self.before).and(primary_ctx::release(self.device)) };
    }
}

/// An error in the words of the driver.
fn failed(error: cudarc::driver::DriverError) -> String {
    let words = error.error_string().map(|words| words.to_string_lossy().into_owned());
    format!("CUDA: {}", words.unwrap_or_else(|_| format!("{:?}", error.0)))
}
