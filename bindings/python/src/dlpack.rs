//! Arrays of other libraries, borrowed by the capsules of DLPack.

use std::{ffi::c_void, marker::PhantomData, slice};

use pyo3::{
    prelude::*,
    types::{PyCapsule, PyCapsuleMethods},
};

use crate::guard::refused;

/// The CPU among the devices of DLPack.
pub(crate) const CPU: i32 = 1;
/// CUDA devices.
#[cfg(feature = "cuda")]
pub(crate) const CUDA: i32 = 2;

/// `DLManagedTensor` as far as it is read: behind it are its owner and how it is freed, which is the capsule's part.
#[repr(C)]
struct Managed {
    data: *mut c_void,
    device: [i32; 2],
    axes: i32,
    code: u8,
    bits: u8,
    lanes: u16,
    shape: *const i64,
    strides: *const i64,
    offset: u64,
}

/// Numbers of a C-contiguous array, at least one, in float32 or float64.
pub(crate) struct Lent<'a> {
    /// Where the first number lies, in the memory of the device.
    pub(crate) address: usize,
    pub(crate) dims: Vec<usize>,
    /// The kind of device, and its number.
    pub(crate) device: [i32; 2],
    /// float64.
    pub(crate) wide: bool,
    capsule: PhantomData<&'a ()>,
}

impl<'a> Lent<'a> {
    /// What a capsule lends while it exists and nobody else takes its array over.
    pub(crate) fn new(capsule: &'a Bound<'_, PyCapsule>) -> PyResult<Self> {
        // A capsule whose array was taken over has another name.
        let managed = capsule.pointer_checked(Some(c"dltensor"))?.cast::<Managed>();
        // SAFETY: a capsule of this name points to a `DLManagedTensor`.
        let managed = unsafe { managed.as_ref() };
        let axes = usize::try_from(managed.axes).map_err(refused)?;
        // SAFETY: where there are axes, each has a length and, unless strides are left out, a stride.
        let [lengths, strides] = [managed.shape, managed.strides].map(|at| {
            (axes > 0 && !at.is_null()).then(|| unsafe { slice::from_raw_parts(at, axes) })
        });
        let lengths = lengths.unwrap_or_default();
        let mut count = 1_i64;
        for (k, &length) in lengths.iter().enumerate().rev() {
            if strides.is_some_and(|strides| length > 1 && strides[k] != count) {
                return Err(refused("an array is not contiguous"));
            }
            count = count.checked_mul(length).filter(|&count| count > 0).ok_or_else(empty)?;
        }
        let (code, bits, lanes) = (managed.code, managed.bits, managed.lanes);
        if code != 2 || lanes != 1 || !matches!(bits, 32 | 64) || lengths.len() != axes {
            return Err(refused("arrays must be float32 or float64"));
        }
        let address = managed.data.addr() + managed.offset as usize;
        if managed.data.is_null() || address % usize::from(bits / 8) != 0 {
            return Err(refused("an array lies nowhere, or between two numbers"));
        }
        let dims = lengths.iter().map(|&length| length as usize).collect();
        let device = managed.device;
        Ok(Self { address, dims, device, wide: bits == 64, capsule: PhantomData })
    }

    pub(crate) fn count(&self) -> usize {
        self.dims.iter().product()
    }

    /// The numbers, if they have this type and lie on the CPU.
    pub(crate) fn numbers<F: numpy::Element + Copy>(&self) -> Option<&'a [F]> {
        let fits = self.device[0] == CPU && size_of::<F>() == if self.wide { 8 } else { 4 };
        // SAFETY: these are as many aligned floats in memory that the capsule keeps.
        fits.then(|| unsafe { slice::from_raw_parts(self.address as *const F, self.count()) })
    }

    /// Writes numbers of the CPU, and returns whether there are as many of this type.
    pub(crate) fn write<F: numpy::Element + Copy>(&self, values: &[F]) -> bool {
        let fits = self.numbers::<F>().is_some_and(|numbers| numbers.len() == values.len());
        if fits {
            let to = self.address as *mut F;
            // SAFETY: as for `numbers`; results were allocated for this call, and nothing else reads them yet.
            unsafe { to.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
        }
        fits
    }
}

fn empty() -> PyErr {
    refused("an array has no numbers, or more than there are addresses")
}
