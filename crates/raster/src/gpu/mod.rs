//! The fused op on the GPU: `CubeCL` kernels over the tensors of the wgpu backend, in f32.
//!
//! The same sums as in `kernel`, in another order of loops. Culling gives every cell of the image a
//! bit for each face; the image is a walk of one unit a pixel over the faces of its cell, and so is
//! the gradient of the table; the gradient to the vertices is gathered, first per face over its
//! pixels and then per vertex over its faces. There are no atomic operations and nothing is read
//! back: every sum has one order, and a step of an optimisation never waits for the GPU. The second
//! order is the same kernels over dual numbers.

#[cfg(not(target_family = "wasm"))]
mod adapter;
mod cells;
mod dual;
mod gradient;
mod image;
mod pair;
mod pass;
mod reach;
mod table;
mod topology;

#[cfg(not(target_family = "wasm"))]
pub use adapter::adapter_name;
pub(crate) use topology::Topology;

use burn::{
    backend::wgpu::{CubeBackend, WgpuRuntime},
    tensor::{
        TensorMetadata,
        ops::{FloatTensor, FloatTensorOps},
    },
};

use crate::{ProfileSum, RasterBackend};
use pass::Pass;

/// Width and height in pixels of the tiles that walk together: one cube of units each.
const TILE: u32 = 8;

/// The wgpu backend in floats of 32 bits: Vulkan, Metal or `WebGPU`, whichever the system has.
pub type Wgpu = CubeBackend<WgpuRuntime, f32, i32, u32>;

impl RasterBackend for Wgpu {
    const ON_HOST: bool = false;

    fn profile_sum(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let views = vertices.shape()[0];
        let sums = Pass::new(op, vertices, table, None).sums();
        Self::float_reshape(sums, [views, op.size, op.size].into())
    }

    fn profile_sum_vjp(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
        wrt_table: bool,
    ) -> FloatTensor<Self> {
        Pass::new(op, vertices, table, None).gradient(upstream, wrt_table)
    }

    fn profile_sum_vjp_of_vjp(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
        direction: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        Pass::new(op, vertices, table, Some(direction)).gradient(upstream, true)
    }
}
