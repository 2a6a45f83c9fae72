//! Masks, and the camera from which a mesh has the silhouette of one.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softrast_inverse::{
    pose::{FoundPose, PoseSearch},
    silhouette_pixels,
};
use softrast_raster::{ImageSize, Pinhole};
use softrast_tensor::NdArray;
use softrast_views::{Picture, mask_iou};

use crate::{
    guard::{guarded, refused},
    meshes::mesh_of,
    watched::{Watch, watched},
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
/// principal point, in pixels from the corner of the picture. `visit` gets the number of each step, how many there are and the least loss. Also whether the
/// search was not interrupted; where it was, the one pose is the best until then.
#[pyfunction]
pub(crate) fn find_pose(
    py: Python<'_>,
    positions: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    mask: PyReadonlyArray2<'_, f32>,
    lens: [f64; 4],
    start: Option<([[f64; 3]; 3], [f64; 3])>,
    visit: Option<Py<PyAny>>,
) -> PyResult<(Vec<Found>, bool)> {
    let [fx, fy, cx, cy] = lens;
    let mesh = mesh_of(&positions, &faces, None)?;
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
    let started = start.is_some();
    let work = move |watch: Watch| {
        let mut best = None;
        let search = PoseSearch::new(&mesh, camera);
        let search = if started { search.starting_at(&camera) } else { search };
        let steps = search.steps(&mask);
        let each = |step: usize, loss: f64, pose: &Pinhole| {
            best = Some(*pose);
            watch.step(step, steps, loss)
        };
        let found = search.progress_with_pose(each).run::<NdArray>(&mask);
        match (found, best) {
            (Err(_), Some(camera)) if watch.is_ended() => {
                let iou = mask_iou(&silhouette_pixels(&mesh, &camera), &mask);
                Ok(vec![FoundPose { camera, iou, psnr: None }])
            }
            (found, _) => found,
        }
    };
    let (poses, interrupted) = watched(py, visit, true, work)?;
    let poses = poses
        .iter()
        .map(|FoundPose { camera, iou, .. }| (camera.rotation, camera.translation, *iou));
    Ok((poses.collect(), !interrupted))
}
