//! The kernels through CUDA in f32 against f64 on the CPU.
//!
//! Prints `skipped` and what is missing if there is no driver, no card, or nothing to compile kernels with.

mod gpu;
mod triangles;

use softrast_raster::{Cuda as Gpu, cuda_device_name as device_name};

/// Copies of a step: on CUDA burn aligns the rows of some tensors, and the kernels read tensors without gaps.
const COPIES: usize = 4;
