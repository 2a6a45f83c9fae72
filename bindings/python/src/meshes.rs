//! Meshes in and out.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softrast_mesh::Mesh;

use crate::guard::{guarded, refused};

/// Positions `[V, 3]` (float64), faces `[F, 3]` (int64), and colours `[V, 3]` in [0, 1] if there are any.
pub(crate) type Parts<'py> =
    (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>, Option<Bound<'py, PyArray2<f64>>>);

/// Reads OBJ, PLY, STL, OFF, GLB or glTF: positions, faces, and colours or None.
#[pyfunction]
pub(crate) fn load_mesh(py: Python<'_>, path: PathBuf) -> PyResult<Parts<'_>> {
    parts(py, &guarded(py, || Mesh::load(path))?.map_err(refused)?)
}

/// Writes OBJ, PLY or GLB, by the ending of the path; whole or not at all.
#[pyfunction]
pub(crate) fn save_mesh(
    py: Python<'_>,
    path: PathBuf,
    positions: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    colours: Option<PyReadonlyArray2<'_, f64>>,
) -> PyResult<()> {
    let mesh = mesh_of(&positions, &faces, colours.as_ref())?;
    guarded(py, || mesh.save(path))?.map_err(refused)
}

/// The fox that the examples draw.
#[pyfunction]
pub(crate) fn fox(py: Python<'_>) -> PyResult<Parts<'_>> {
    parts(py, &softrast_mesh::fox())
}

/// A sphere of radius 1 with `20 · 4^subdivisions` faces.
#[pyfunction]
pub(crate) fn icosphere(py: Python<'_>, subdivisions: u32) -> PyResult<Parts<'_>> {
    if subdivisions > 9 {
        return Err(refused(format!(
            "a sphere of {subdivisions} subdivisions is too large, expected 0 to 9"
        )));
    }
    parts(py, &softrast_mesh::icosphere(subdivisions))
}

pub(crate) fn parts<'py>(py: Python<'py>, mesh: &Mesh) -> PyResult<Parts<'py>> {
    let rows =
        |rows: &[[f64; 3]]| PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), 3]);
    let faces: Vec<i64> = mesh.faces().as_flattened().iter().map(|&v| i64::from(v)).collect();
    let faces = PyArray1::from_vec(py, faces).reshape([mesh.faces().len(), 3])?;
    Ok((rows(mesh.positions())?, faces, mesh.colours().map(rows).transpose()?))
}

/// The mesh of positions `[V, 3]`, faces `[F, 3]` and, if there are any, colours `[V, 3]` in [0, 1].
pub(crate) fn mesh_of(
    positions: &PyReadonlyArray2<'_, f64>,
    faces: &PyReadonlyArray2<'_, i64>,
    colours: Option<&PyReadonlyArray2<'_, f64>>,
) -> PyResult<Mesh> {
    let mesh = Mesh::new(triples(positions, "positions")?, numbers(faces)?).map_err(refused)?;
    let Some(colours) = colours else { return Ok(mesh) };
    mesh.with_colours(triples(colours, "colours")?).map_err(refused)
}

/// Faces as vertex numbers.
fn numbers(faces: &PyReadonlyArray2<'_, i64>) -> PyResult<Vec<[u32; 3]>> {
    let face = |(k, face): (usize, &[i64; 3])| {
        let wrong = || refused(format!("face {k} is {face:?}, expected three vertex numbers"));
        let number = |corner: i64| u32::try_from(corner).map_err(|_| wrong());
        Ok([number(face[0])?, number(face[1])?, number(face[2])?])
    };
    triples(faces, "faces")?.iter().enumerate().map(face).collect()
}

/// The rows of an array `[N, 3]`.
fn triples<T: numpy::Element + Copy>(
    array: &PyReadonlyArray2<'_, T>,
    name: &str,
) -> PyResult<Vec<[T; 3]>> {
    let shape = array.shape();
    if shape[1] != 3 {
        return Err(refused(format!("{name} must be [N, 3], found {shape:?}")));
    }
    let array = array.as_array();
    Ok(array.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}
