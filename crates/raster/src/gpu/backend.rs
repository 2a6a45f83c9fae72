use softrast_tensor::wgpu::{CubeBackend, WgpuRuntime};

/// The wgpu backend in floats of 32 bits: Vulkan, Metal or `WebGPU`, whichever the system has.
pub type Wgpu = CubeBackend<WgpuRuntime, f32, i32, u32>;
