use std::sync::OnceLock;

use cudarc::{driver, nvrtc};
use softrast_tensor::cuda::{CudaDevice, install};

use crate::NoAdapter;

/// The name of the default CUDA device: `NVIDIA H200`. Checks once that driver, device, compiler and headers are there.
///
/// Without this call, the first tensor panics if one of them is missing.
///
/// # Errors
///
/// [`NoAdapter`] with the first of them that is missing.
pub fn cuda_device_name() -> Result<&'static str, NoAdapter> {
    static NAME: OnceLock<Result<String, NoAdapter>> = OnceLock::new();
    NAME.get_or_init(find).as_deref().map_err(Clone::clone)
}

fn find() -> Result<String, NoAdapter> {
    let [driver, compiler] = libraries();
    if !driver {
        return Err(NoAdapter::CudaDriver);
    }
    let name = device_name().map_err(|error| NoAdapter::CudaDevice(reason(error)))?;
    if !compiler {
        return Err(NoAdapter::CudaCompiler);
    }
    // The kernels include it.
    let header = install::cuda_path().map(|path| path.join("include/cuda_runtime.h"));
    if header.is_none_or(|header| !header.is_file()) {
        return Err(NoAdapter::CudaHeaders);
    }
    Ok(name)
}

/// Whether the driver and the compiler of kernels can be loaded.
#[allow(unsafe_code, reason = "loading a library runs its initialisers, as the first tensor does")]
fn libraries() -> [bool; 2] {
    unsafe { [driver::sys::is_culib_present(), nvrtc::sys::is_culib_present()] }
}

fn device_name() -> Result<String, driver::DriverError> {
    driver::result::init()?;
    let index = CudaDevice::default().index as i32;
    driver::result::device::get_name(driver::result::device::get(index)?)
}

/// An error in the words of the driver.
fn reason(error: driver::DriverError) -> String {
    let words = error.error_string().map(|words| words.to_string_lossy().into_owned());
    words.unwrap_or_else(|_| format!("{:?}", error.0))
}
