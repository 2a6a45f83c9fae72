//! Arrays of either float type, as frameworks hand them in and get them back.

use std::{
    any::Any,
    borrow::Cow,
    ops::{Add, Mul},
    sync::Arc,
};

use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softrast_raster::low_level::Numbers;

use crate::guard::refused;

/// An array of a call: C-contiguous, borrowed or owned.
#[derive(Clone)]
pub(crate) struct Array<'a> {
    /// The lengths of its axes.
    pub(crate) dims: Vec<usize>,
    /// The numbers, as many as the lengths multiply to.
    pub(crate) numbers: Floats<'a>,
}

/// Numbers of one float type.
#[derive(Clone)]
pub(crate) enum Floats<'a> {
    F32(Cow<'a, [f32]>),
    F64(Cow<'a, [f64]>),
    /// A tensor on a device, see [`crate::device::On`].
    Device(Arc<dyn Any + Send + Sync>),
}

/// float32 or float64.
pub(crate) trait Float:
    Numbers + numpy::Element + Add<Output = Self> + Mul<Output = Self>
{
    /// Numbers of any type as those of this one, if they are.
    fn of<'a>(floats: &'a Floats<'_>) -> Option<&'a [Self]>;
    /// Numbers of this type as those of any.
    fn any<'a>(values: impl Into<Cow<'a, [Self]>>) -> Floats<'a>;
    /// The bits of a number.
    fn bits(self) -> u64;
}

macro_rules! float {
    ($float:ty, $kind:ident) => {
        impl Float for $float {
            fn of<'a>(floats: &'a Floats<'_>) -> Option<&'a [Self]> {
                if let Floats::$kind(values) = floats { Some(values) } else { None }
            }

            fn any<'a>(values: impl Into<Cow<'a, [Self]>>) -> Floats<'a> {
                Floats::$kind(values.into())
            }

            fn bits(self) -> u64 {
                self.to_bits().into()
            }
        }
    };
}

float!(f32, F32);
float!(f64, F64);

/// Whether two slices have the same bits.
pub(crate) fn same<F: Float>(a: &[F], b: &[F]) -> bool {
    let differ = |a: &[F], b: &[F]| {
        a.iter().zip(b).fold(0, |bits, (a, b)| bits | (a.bits() ^ b.bits())) != 0
    };
    // Long enough for vectors of the processor, short enough to end early.
    a.len() == b.len() && !a.chunks(256).zip(b.chunks(256)).any(|(a, b)| differ(a, b))
}

pub(crate) const MIXED: &str =
    "the arrays of a call must be of one type, float32 or float64: convert them with astype";

impl Floats<'_> {
    /// A part of the numbers.
    fn part(&self, range: std::ops::Range<usize>) -> Floats<'_> {
        match self {
            Self::F32(values) => f32::any(&values[range]),
            Self::F64(values) => f64::any(&values[range]),
            Self::Device(_) => unreachable!("arrays on a device have no axes in front"),
        }
    }

    /// Puts numbers of the same type behind these.
    pub(crate) fn extend(&mut self, others: &Floats<'_>) {
        match (self, others) {
            (Self::F32(values), Floats::F32(others)) => values.to_mut().extend_from_slice(others),
            (Self::F64(values), Floats::F64(others)) => values.to_mut().extend_from_slice(others),
            _ => unreachable!("results of one function"),
        }
    }

    /// These numbers in float64.
    pub(crate) fn wide(&self) -> Result<Vec<f64>, String> {
        match self {
            Self::F32(values) => Ok(values.iter().map(|&x| f64::from(x)).collect()),
            Self::F64(values) => Ok(values.to_vec()),
            Self::Device(_) => Err("φ must lie on the CPU".to_owned()),
        }
    }

    /// Numbers rounded to the type of these.
    pub(crate) fn like(&self, values: Vec<f64>) -> Floats<'static> {
        match self {
            Self::F32(_) => f32::any(values.into_iter().map(|x| x as f32).collect::<Vec<_>>()),
            Self::F64(_) | Self::Device(_) => f64::any(values),
        }
    }
}

impl Array<'_> {
    /// The part `k` of those that have the shape `dims`.
    pub(crate) fn part(&self, dims: Vec<usize>, k: usize) -> Array<'_> {
        let count: usize = dims.iter().product();
        Array { dims, numbers: self.numbers.part(k * count..(k + 1) * count) }
    }
}

/// An array of NumPy, borrowed until it is dropped.
pub(crate) enum Borrowed<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> Borrowed<'py> {
    pub(crate) fn new(array: &Bound<'py, PyAny>) -> PyResult<Self> {
        if array.cast::<PyArrayDyn<f32>>().is_ok() {
            return Ok(Self::F32(array.extract()?));
        }
        array.extract().map(Self::F64).map_err(|_| refused(MIXED))
    }

    pub(crate) fn array(&self) -> PyResult<Array<'_>> {
        let wrong = |_| refused("an array is not contiguous");
        Ok(match self {
            Self::F32(array) => Array {
                dims: array.shape().to_vec(),
                numbers: f32::any(array.as_slice().map_err(wrong)?),
            },
            Self::F64(array) => Array {
                dims: array.shape().to_vec(),
                numbers: f64::any(array.as_slice().map_err(wrong)?),
            },
        })
    }
}

impl Array<'_> {
    /// An array of NumPy with these numbers.
    pub(crate) fn into_numpy(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        Ok(match self.numbers {
            Floats::F32(values) => {
                PyArray1::from_vec(py, values.into_owned()).reshape(self.dims)?.into_any()
            }
            Floats::F64(values) => {
                PyArray1::from_vec(py, values.into_owned()).reshape(self.dims)?.into_any()
            }
            Floats::Device(_) => unreachable!("results of arrays of the host"),
        })
    }
}
