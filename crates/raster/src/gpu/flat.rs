//! Tensors that hold several, concatenated.

use softrast_tensor::{FloatDType, FloatTensor, FloatTensorOps, Slice, TensorMetadata};

use super::backend::Wgpu;

pub(super) fn length(tensor: &FloatTensor<Wgpu>) -> usize {
    tensor.shape().num_elements()
}

/// The wanted parts of a flat tensor, concatenated.
pub(super) fn parts(
    flat: FloatTensor<Wgpu>,
    lengths: &[usize],
    wanted: &[bool],
) -> FloatTensor<Wgpu> {
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

/// The inverse of [`parts`]: zeros in place of missing parts.
pub(super) fn whole_direction(
    flat: FloatTensor<Wgpu>,
    lengths: &[usize],
    there: &[bool],
) -> FloatTensor<Wgpu> {
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
