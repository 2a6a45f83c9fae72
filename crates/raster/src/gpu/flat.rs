//! Tensors that hold several, concatenated.

use softrast_tensor::{FloatDType, FloatTensorOps, Slice, TensorMetadata, gpu::CubeRuntime};

use super::{backend::Floats, prepared::Buffer};

pub(super) fn length<R: CubeRuntime>(tensor: &Buffer<R>) -> usize {
    tensor.shape().num_elements()
}

/// The wanted parts of a flat tensor, concatenated.
pub(super) fn parts<R: CubeRuntime>(
    flat: Buffer<R>,
    lengths: &[usize],
    wanted: &[bool],
) -> Buffer<R> {
    if wanted.iter().all(|&wanted| wanted) {
        return flat;
    }
    let mut start = 0;
    let mut chosen = Vec::new();
    for (&length, &wanted) in lengths.iter().zip(wanted) {
        if wanted {
            chosen.push(Floats::<R>::float_slice(
                flat.clone(),
                &[Slice::from(start..start + length)],
            ));
        }
        start += length;
    }
    if chosen.len() == 1 { chosen.remove(0) } else { Floats::<R>::float_cat(chosen, 0) }
}

/// The inverse of [`parts`]: zeros in place of missing parts.
pub(super) fn whole_direction<R: CubeRuntime>(
    flat: Buffer<R>,
    lengths: &[usize],
    there: &[bool],
) -> Buffer<R> {
    if there.iter().all(|&there| there) {
        return flat;
    }
    let device = Floats::<R>::float_device(&flat);
    let mut start = 0;
    let part = |(&length, &there): (&usize, &bool)| {
        if !there {
            return Floats::<R>::float_zeros([length].into(), &device, FloatDType::F32);
        }
        start += length;
        Floats::<R>::float_slice(flat.clone(), &[Slice::from(start - length..start)])
    };
    Floats::<R>::float_cat(lengths.iter().zip(there).map(part).collect(), 0)
}
