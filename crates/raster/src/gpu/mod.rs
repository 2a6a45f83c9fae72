//! The fused ops on the GPU: `CubeCL` kernels over the tensors of the backends wgpu and CUDA, in f32.
//!
//! They compute the sums of `softrast-kernel` face by face. A few units share a face and add its terms to the pixels of its bounding box as
//! integers, by atomic operations whose order does not matter. So no kernel needs the faces of a pixel, and nothing is culled, sorted or
//! read back. Vertex gradients are gathered, first per face over its pixels, then per vertex over its faces. Cameras and losses are kernels
//! too, so a step launches fewer than twenty. Results are deterministic. The second order uses the same kernels over dual numbers.

#[cfg(all(feature = "wgpu", not(target_family = "wasm")))]
mod adapter;
mod backend;
mod blend;
mod blend_inputs;
mod blend_pass;
mod camera;
#[cfg(feature = "cuda")]
mod cuda;
mod depth;
mod dual;
mod elementary;
mod face_attributes;
mod flat;
mod frame;
mod gradient;
mod kept;
mod losses;
mod of_pixel;
mod pair;
mod parts;
mod pass;
mod prepare;
mod prepared;
mod reach;
mod splat;
mod table;
mod texels;
mod texture;
mod topology;
mod whole;

#[cfg(all(feature = "wgpu", not(target_family = "wasm")))]
pub use adapter::adapter_name;
#[cfg(feature = "cuda")]
pub use backend::Cuda;
#[cfg(feature = "wgpu")]
pub use backend::Wgpu;
#[cfg(feature = "cuda")]
pub use cuda::cuda_device_name;
pub(crate) use prepared::SumOnGpu;
pub(crate) use topology::Topology;

use softrast_tensor::{
    FloatTensorOps, TensorMetadata,
    gpu::{BoolElement, CubeBackend, CubeRuntime},
};

use crate::{FusedOp, Pass, RasterBackend, SoftBlend};
use backend::Floats;
use blend_pass::{Blend, as_sum};
use flat::{length, parts, whole_direction};
use pass::Pass as Kernels;
use prepared::Buffer;

impl<R: CubeRuntime, BT: BoolElement> RasterBackend for CubeBackend<R, f32, i32, BT> {
    const ON_HOST: bool = false;

    fn run(op: &FusedOp, pass: &Pass, tensors: Vec<Buffer<R>>) -> Buffer<R> {
        let op = match op {
            FusedOp::ProfileSum(op) => op,
            FusedOp::SoftBlend(op) => return blended(op, pass, tensors),
            FusedOp::Elementary(op) => return elementary::run(*op, pass, tensors),
            FusedOp::SilhouetteLoss(_) | FusedOp::BlendLoss(_) => {
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
                let kernels = Kernels::new(op, vertices, table, None);
                if !wanted[1] {
                    return kernels.to_vertices(next());
                }
                parts(kernels.gradient(next()), &[coordinates, coefficients], wanted)
            }
            Pass::VjpOfVjp { along, wanted } => {
                let (upstream, direction) = (next(), next());
                let direction = whole_direction(direction, &[coordinates, coefficients], along);
                let pixels = length(&upstream);
                let kernels = Kernels::new(op, vertices, table, Some(direction));
                let flat = kernels.gradient(upstream);
                parts(flat, &[coordinates, coefficients, pixels], wanted)
            }
        }
    }
}

/// A pass of the colour op.
fn blended<R: CubeRuntime>(op: &SoftBlend, pass: &Pass, tensors: Vec<Buffer<R>>) -> Buffer<R> {
    let count = 4 + usize::from(op.texture.is_some());
    let mut inputs = tensors;
    let mut rest = inputs.split_off(count).into_iter();
    let mut next = || rest.next().expect("all inputs of the pass");
    let lengths: Vec<usize> = inputs.iter().map(length).collect();
    let shape = [inputs[0].shape()[0], lengths[3], op.size.height, op.size.width];
    let sum = as_sum(op);
    let (direction, wanted, upstream) = match pass {
        Pass::Forward => {
            let image = Blend::new(op, &sum, inputs, None).image();
            return Floats::<R>::float_reshape(image, shape.into());
        }
        Pass::Vjp { wanted } => (None, wanted, next()),
        Pass::VjpOfVjp { along, wanted } => {
            let upstream = next();
            (Some(whole_direction(next(), &lengths, along)), wanted, upstream)
        }
    };
    let of_texels = op.texture.is_some() && wanted[4];
    let blend = Blend::new(op, &sum, inputs, direction);
    let found = blend.gradient(upstream, wanted[2], of_texels);
    let mut parts =
        vec![Some(found.vertices), Some(found.attributes), found.tables, Some(found.background)];
    if op.texture.is_some() {
        parts.push(found.texture);
    }
    parts.push(Some(found.image));
    let parts = parts.into_iter().zip(wanted).filter(|&(_, &wanted)| wanted);
    Floats::<R>::float_cat(parts.filter_map(|(part, _)| part).collect(), 0)
}
