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
mod blend;
mod blend_pass;
mod cells;
mod dual;
mod frame;
mod gradient;
mod image;
mod pair;
mod pass;
mod reach;
mod shown;
mod table;
mod topology;

#[cfg(not(target_family = "wasm"))]
pub use adapter::adapter_name;
pub(crate) use topology::Topology;

use burn::{
    backend::wgpu::{CubeBackend, WgpuRuntime},
    tensor::{
        FloatDType, Slice, TensorMetadata,
        ops::{FloatTensor, FloatTensorOps},
    },
};

use crate::{FusedOp, Pass, RasterBackend, SoftBlend};
use blend_pass::{Blend, Inputs, culling};
use pass::Pass as Kernels;

/// Width and height in pixels of the tiles that walk together: one cube of units each.
const TILE: u32 = 8;

/// The wgpu backend in floats of 32 bits: Vulkan, Metal or `WebGPU`, whichever the system has.
pub type Wgpu = CubeBackend<WgpuRuntime, f32, i32, u32>;

impl RasterBackend for Wgpu {
    const ON_HOST: bool = false;

    fn run(op: &FusedOp, pass: &Pass, tensors: Vec<FloatTensor<Self>>) -> FloatTensor<Self> {
        let op = match op {
            FusedOp::ProfileSum(op) => op,
            FusedOp::SoftBlend(op) => return blended(op, pass, tensors),
            FusedOp::Elementary(_) | FusedOp::SilhouetteLoss(_) => {
                panic!("on a GPU {op:?} is made of other ops")
            }
        };
        let mut tensors = tensors.into_iter();
        let mut next = || tensors.next().expect("all inputs of the pass");
        let (vertices, table) = (next(), next());
        let (coordinates, coefficients) = (length(&vertices), length(&table));
        match pass {
            Pass::Forward => {
                let shape = [vertices.shape()[0], op.size.height, op.size.width];
                Self::float_reshape(Kernels::new(op, vertices, table, None).sums(), shape.into())
            }
            Pass::Vjp { wanted } => {
                let flat = Kernels::new(op, vertices, table, None).gradient(next(), wanted[1]);
                parts(flat, &[coordinates, coefficients], wanted)
            }
            Pass::VjpOfVjp { along, wanted } => {
                let (upstream, direction) = (next(), next());
                let direction = whole(direction, &[coordinates, coefficients], along);
                let pixels = length(&upstream);
                let kernels = Kernels::new(op, vertices, table, Some(direction));
                let flat = kernels.gradient(upstream, true);
                parts(flat, &[coordinates, coefficients, pixels], wanted)
            }
        }
    }
}

/// A pass of the op of colours, without a texture. Tables have no gradient.
fn blended(op: &SoftBlend, pass: &Pass, tensors: Vec<FloatTensor<Wgpu>>) -> FloatTensor<Wgpu> {
    assert!(op.texture.is_none(), "on a GPU a texture is seen through tensor ops");
    let mut tensors = tensors.into_iter();
    let mut next = || tensors.next().expect("all inputs of the pass");
    let [vertices, attributes, tables, background] = [next(), next(), next(), next()];
    let inputs = [&vertices, &attributes, &tables, &background];
    let lengths = inputs.map(length);
    let shape = [vertices.shape()[0], lengths[3], op.size.height, op.size.width];
    let mut inputs = Inputs { vertices, attributes, tables, background, along: None };
    let culling = culling(op);
    match pass {
        Pass::Forward => {
            let image = Blend::new(op, &culling, inputs).image();
            Wgpu::float_reshape(image, shape.into())
        }
        Pass::Vjp { wanted } => {
            assert!(!wanted[2], "on a GPU a gradient to tables goes through tensor ops");
            let [vertices, attributes, background, _] =
                Blend::new(op, &culling, inputs).gradient(next());
            let parts = [vertices, attributes, background];
            chosen(parts.into(), &[wanted[0], wanted[1], wanted[3]])
        }
        Pass::VjpOfVjp { along, wanted } => {
            assert!(!wanted[2], "on a GPU a gradient to tables goes through tensor ops");
            let (upstream, direction) = (next(), next());
            let direction = whole(direction, &lengths, along);
            let mut start = 0;
            inputs.along = Some(lengths.map(|length| {
                start += length;
                Wgpu::float_slice(direction.clone(), &[Slice::from(start - length..start)])
            }));
            let parts = Blend::new(op, &culling, inputs).gradient(upstream);
            chosen(parts.into(), &[wanted[0], wanted[1], wanted[3], wanted[4]])
        }
    }
}

/// Those of some flat tensors that are wanted, as one.
fn chosen(parts: Vec<FloatTensor<Wgpu>>, wanted: &[bool]) -> FloatTensor<Wgpu> {
    let parts = parts.into_iter().zip(wanted).filter(|&(_, &wanted)| wanted);
    Wgpu::float_cat(parts.map(|(part, _)| part).collect(), 0)
}

fn length(tensor: &FloatTensor<Wgpu>) -> usize {
    tensor.shape().num_elements()
}

/// Those parts of a flat tensor that are wanted, flat.
fn parts(flat: FloatTensor<Wgpu>, lengths: &[usize], wanted: &[bool]) -> FloatTensor<Wgpu> {
    if wanted.iter().all(|&wanted| wanted) {
        return flat;
    }
    let mut start = 0;
    let mut chosen = Vec::new();
    for (&length, &wanted) in lengths.iter().zip(wanted) {
        if wanted {
            chosen.push(Wgpu::float_slice(flat.clone(), &[Slice::from(start..start + length)]));
        }
        start += length;
    }
    if chosen.len() == 1 { chosen.remove(0) } else { Wgpu::float_cat(chosen, 0) }
}

/// The inverse: zeros where a part is missing.
fn whole(flat: FloatTensor<Wgpu>, lengths: &[usize], there: &[bool]) -> FloatTensor<Wgpu> {
    if there.iter().all(|&there| there) {
        return flat;
    }
    let device = Wgpu::float_device(&flat);
    let mut start = 0;
    let part = |(&length, &there): (&usize, &bool)| {
        if !there {
            return Wgpu::float_zeros([length].into(), &device, FloatDType::F32);
        }
        start += length;
        Wgpu::float_slice(flat.clone(), &[Slice::from(start - length..start)])
    };
    Wgpu::float_cat(lengths.iter().zip(there).map(part).collect(), 0)
}
