use softrast_tensor::gpu::CubeBackend;

/// The wgpu backend in f32: Vulkan, Metal or `WebGPU`, whichever the system has.
#[cfg(feature = "wgpu")]
pub type Wgpu = CubeBackend<softrast_tensor::wgpu::WgpuRuntime, f32, i32, u32>;

/// The CUDA backend in f32.
#[cfg(feature = "cuda")]
pub type Cuda = CubeBackend<softrast_tensor::cuda::CudaRuntime, f32, i32, u8>;

/// The ops of buffers of floats. Backends that differ in the type of bools share their buffers.
pub(super) type Floats<R> = CubeBackend<R, f32, i32, u32>;
