use softrast_tensor::wgpu::{CubeBackend, WgpuRuntime};

/// The wgpu backend in f32: Vulkan, Metal or `WebGPU`, whichever the system has.
pub type Wgpu = CubeBackend<WgpuRuntime, f32, i32, u32>;
