//! The kernels through wgpu in f32 against f64 on the CPU.
//!
//! Runs on any adapter that wgpu finds, including Mesa's software Vulkan, and prints `skipped` if there is none.

mod gpu;
mod triangles;

use softrast_raster::{Wgpu as Gpu, adapter_name as device_name};

/// Copies of a step. There are none: burn uploads tensors without gaps.
const COPIES: usize = 0;
