//! Masks, and the camera from which a mesh has the silhouette of one.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softrast_inverse::pose::PoseSearch;
use softrast_raster::{ImageSize, Pinhole};
use softrast_tensor::NdArray;
use softrast_views::Picture;

use crate::{
    guard::{guarded, refused},
    meshes::mesh_of,
};

/// R row by row, t, and overlap over union.
type Found = ([[f64; 3]; 3], [f64; 3], f64);

/// Reads a mask from a picture: levels `[height, width]` in [0, 1], float32.
#[pyfunction]
pub(crate) fn load_mask(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let mask = guarded(py, || Picture::load_mask(path).map_err(|error| format!("{error:#}")))?
        .map_err(refused)?;
    let ImageSize { height, width } = mask.size();
    PyArray1::from_slice(py, mask.pixels()).reshape([height, width])
}

/// The poses from which a mesh has the silhouette of a mask `[height, width]`, the best first, through a lens: focal lengths and the
/// principal point, in pixels from the corner of the picture. `visit` gets the number of each step, how many there are and the least loss.
#[pyfunction]
pub(crate) fn find_pose(
    py: Python<'_>,
    positions: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    mask: PyReadonlyArray2<'_, f32>,
    lens: [f64; 4],
    start: Option<([[f64; 3]; 3], [f64; 3])>,
    visit: Option<Py<PyAny>>,
) -> PyResult<Vec<Found>> {
    let [fx, fy, cx, cy] = lens;
    let mesh = mesh_of(&positions, &faces)?;
    let &[height, width] = mask.shape() else { unreachable!("two axes") };
    if height == 0 || width == 0 {
        return Err(refused(format!("the mask is [{height}, {width}], expected pixels")));
    }
    let mask = Picture::new(mask.as_array().iter().copied().collect(), width);
    let one = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let (rotation, translation) = start.unwrap_or((one, [0.0; 3]));
    let camera =
        Pinhole { rotation, translation, focal: [fx, fy], centre: [cx, cy], size: mask.size() };
    camera.check().map_err(refused)?;
    let mut raised = None;
    let found = guarded(py, || {
        let search = PoseSearch::new(&mesh, camera);
        let search = if start.is_some() { search.starting_at(&camera) } else { search };
        let steps = search.steps(&mask);
        // Ctrl-C is seen at each step, which takes milliseconds.
        let seen = |step: usize, loss: f64| {
            let shown = Python::attach(|py| {
                py.check_signals()?;
                visit
                    .as_ref()
                    .map_or(Ok(()), |visit| visit.call1(py, (step, steps, loss)).map(drop))
            });
            shown.map_err(|error| {
                raised = Some(error);
                anyhow::anyhow!("the search was ended")
            })
        };
        search.progress(seen).run::<NdArray>(&mask).map_err(|error| format!("{error:#}"))
    })?;
    if let Some(error) = raised {
        return Err(error);
    }
    let poses = found.map_err(refused)?;
    Ok(poses.iter().map(|pose| (pose.camera.rotation, pose.camera.translation, pose.iou)).collect())
}
