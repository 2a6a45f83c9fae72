//! Arguments are checked before anything is computed.

use std::sync::Arc;

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::guard::refused;

pub(crate) fn check_tolerance(tolerance: f64) -> PyResult<()> {
    if tolerance > 0.0 && tolerance < 1.0 {
        return Ok(());
    }
    Err(refused(format!("the tolerance is {tolerance}, expected more than 0 and less than 1")))
}

pub(crate) fn check_size(size: [usize; 2]) -> PyResult<()> {
    if !size.contains(&0) {
        return Ok(());
    }
    Err(refused(format!("the image is {size:?}, expected at least one pixel")))
}

pub(crate) fn check_progress(progress: f64) -> PyResult<()> {
    if (0.0..=1.0).contains(&progress) {
        return Ok(());
    }
    Err(refused(format!("the progress of a run is {progress}, expected 0 to 1")))
}

/// `name` is that of the argument, `of` that of the softness, which has `expected` parameters.
pub(crate) fn check_phi(name: &str, of: &str, expected: usize, phi: &[f64]) -> Result<(), String> {
    if phi.len() != expected {
        let found = phi.len();
        return Err(format!("{name} of {of} has {expected} parameters, found {found}"));
    }
    match phi.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(k) => Err(format!("{name}[{k}] is {}, expected a finite number", phi[k])),
    }
}

/// How many vertices or entries these corners ask for.
pub(crate) fn least(corners: &[[u32; 3]]) -> usize {
    corners.iter().flatten().max().map_or(0, |&most| most as usize + 1)
}

/// Corners of faces `[F, 3]` as vertex numbers.
pub(crate) fn corners(faces: &PyReadonlyArray2<'_, i64>) -> PyResult<Arc<[[u32; 3]]>> {
    let &[count, three] = faces.shape() else { unreachable!("two axes") };
    if count == 0 || three != 3 {
        return Err(refused(format!(
            "faces must be [F, 3] with at least one face, found [{count}, {three}]"
        )));
    }
    let faces = faces.as_array();
    let corner = |face: usize, k: usize| {
        let number = faces[[face, k]];
        // One more than the largest must be a number too.
        u32::try_from(number).ok().filter(|&number| number < u32::MAX).ok_or_else(|| {
            refused(format!("face {face} uses vertex {number}, expected 0 to 4294967294"))
        })
    };
    let of = |face: usize| Ok([corner(face, 0)?, corner(face, 1)?, corner(face, 2)?]);
    (0..count).map(of).collect()
}
