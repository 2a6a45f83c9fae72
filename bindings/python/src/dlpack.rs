//! Arrays of other libraries, borrowed by the capsules of DLPack.

use std::{ffi::c_void, marker::PhantomData, slice};

use pyo3::{
    prelude::*,
    types::{PyCapsule, PyCapsuleMethods},
};

use crate::{arrays::Float, guard::refused};

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
    /// The array of a capsule, which lends it while it exists and nobody else takes it over.
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
            let more = count.checked_mul(length).filter(|&more| more > 0 && more <= i64::MAX / 8);
            count = more.ok_or_else(|| refused("an array has no numbers, or too many"))?;
        }
        let (code, bits, lanes) = (managed.code, managed.bits, managed.lanes);
        if code != 2 || lanes != 1 || !matches!(bits, 32 | 64) || lengths.len() != axes {
            return Err(refused("arrays must be float32 or float64"));
        }
        let address = managed.data.expose_provenance().checked_add(managed.offset as usize);
        let aligned = |address: &usize| address.is_multiple_of(usize::from(bits / 8));
        let address = address.filter(aligned).filter(|_| !managed.data.is_null());
        let address = address.ok_or_else(|| refused("an array lies nowhere, or is not aligned"))?;
        let dims = lengths.iter().map(|&length| length as usize).collect();
        let device = managed.device;
        Ok(Self { address, dims, device, wide: bits == 64, capsule: PhantomData })
    }

    pub(crate) fn count(&self) -> usize {
        self.dims.iter().product()
    }

    /// Whether the numbers have this type and lie on the CPU.
    fn holds<F: Float>(&self) -> bool {
        self.device[0] == CPU && size_of::<F>() == if self.wide { 8 } else { 4 }
    }

    /// The numbers, if they have this type and lie on the CPU.
    pub(crate) fn numbers<F: Float>(&self) -> Option<&'a [F]> {
        // SAFETY: these are as many aligned floats in memory that the capsule keeps.
        self.holds::<F>().then(|| unsafe {
            slice::from_raw_parts(
                std::ptr::with_exposed_provenance::<F>(self.address),
                self.count(),
            )
        })
    }

    /// Writes numbers on the CPU. Returns whether there are as many of this type.
    pub(crate) fn write<F: Float>(&self, values: &[F]) -> bool {
        let fits = self.holds::<F>() && self.count() == values.len();
        if fits {
            let to = std::ptr::with_exposed_provenance_mut::<F>(self.address);
            // SAFETY: as for `numbers`; results were allocated for this call, and nothing else uses them yet.
            unsafe { to.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
        }
        fits
    }
}
