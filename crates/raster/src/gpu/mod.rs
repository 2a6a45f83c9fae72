//! The fused op on the GPU: `CubeCL` kernels over the tensors of the wgpu backend, in f32.
//!
//! The same sums as in `softrast-kernel`, in another order of loops. Culling gives every cell of the image a
//! bit for each face; the image is a walk of one unit a pixel over the faces of its cell, and so is
//! the gradient of the table; the gradient to the vertices is gathered, first per face over its
//! pixels and then per vertex over its faces. They read nothing back. Every sum of floats has
//! one order; the gradient of a texture is added up in whole numbers by atomic operations, where the order does not matter. The second order is the same kernels over dual numbers.

#[cfg(not(target_family = "wasm"))]
mod adapter;
mod backend;
mod blend;
mod blend_inputs;
mod blend_pass;
mod cells;
mod depth;
mod dual;
mod face_attributes;
mod frame;
mod gradient;
mod image;
mod of_pixel;
mod pair;
mod pass;
mod reach;
mod table;
mod texels;
mod texture;
mod tile;
mod topology;

#[cfg(not(target_family = "wasm"))]
pub use adapter::adapter_name;
pub use backend::Wgpu;
pub(crate) use topology::Topology;

use softrast_tensor::{FloatDType, FloatTensor, FloatTensorOps, Slice, TensorMetadata};

use crate::{FusedOp, Pass, RasterBackend, SoftBlend};
use blend_pass::{Blend, culling};
use pass::Pass as Kernels;

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

/// A pass of the op of colours.
fn blended(op: &SoftBlend, pass: &Pass, tensors: Vec<FloatTensor<Wgpu>>) -> FloatTensor<Wgpu> {
    let count = 4 + usize::from(op.texture.is_some());
    let mut inputs = tensors;
    let mut rest = inputs.split_off(count).into_iter();
    let mut next = || rest.next().expect("all inputs of the pass");
    let lengths: Vec<usize> = inputs.iter().map(length).collect();
    let shape = [inputs[0].shape()[0], lengths[3], op.size.height, op.size.width];
    let culling = culling(op);
    let (direction, wanted, upstream) = match pass {
        Pass::Forward => {
            let image = Blend::new(op, &culling, inputs, None).image();
            return Wgpu::float_reshape(image, shape.into());
        }
        Pass::Vjp { wanted } => (None, wanted, next()),
        Pass::VjpOfVjp { along, wanted } => {
            let upstream = next();
            (Some(whole(next(), &lengths, along)), wanted, upstream)
        }
    };
    let of_texels = op.texture.is_some() && wanted[4];
    let blend = Blend::new(op, &culling, inputs, direction);
    let found = blend.gradient(upstream, wanted[2], of_texels);
    let mut parts =
        vec![Some(found.vertices), Some(found.attributes), found.tables, Some(found.background)];
    if op.texture.is_some() {
        parts.push(found.texture);
    }
    parts.push(Some(found.image));
    let parts = parts.into_iter().zip(wanted).filter(|&(_, &wanted)| wanted);
    Wgpu::float_cat(parts.filter_map(|(part, _)| part).collect(), 0)
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
