/// The system lacks what a backend for GPUs needs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoAdapter {
    /// No adapter that wgpu could run on.
    #[error(
        "no adapter for wgpu found: install the Vulkan driver of your graphics card, or Mesa's software \
         Vulkan (Debian, Ubuntu: apt install mesa-vulkan-drivers libvulkan1)"
    )]
    Wgpu,
    /// No driver for CUDA.
    #[error(
        "no driver for CUDA found (libcuda.so.1, on Windows nvcuda.dll): install the driver of your NVIDIA card, \
         or use the backend wgpu"
    )]
    CudaDriver,
    /// No device, or one that the driver cannot use; with the driver's reason.
    #[error("the driver for CUDA finds no card that can be used: {0}")]
    CudaDevice(String),
    /// No compiler of kernels.
    #[error(
        "no NVRTC found (libnvrtc.so), which compiles the kernels for CUDA: install a CUDA toolkit, or add the \
         folder of the library to LD_LIBRARY_PATH"
    )]
    CudaCompiler,
    /// No headers for the compiler.
    #[error(
        "no CUDA headers found (include/cuda_runtime.h), which the kernels include: install a CUDA toolkit, or set \
         CUDA_PATH to the folder that holds include"
    )]
    CudaHeaders,
}
