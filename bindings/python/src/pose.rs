//! Masks, and the camera from which a mesh has the silhouette of one.

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::Duration,
};

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softrast_inverse::pose::PoseSearch;
use softrast_raster::{ImageSize, Pinhole};
use softrast_tensor::NdArray;
use softrast_views::Picture;

use crate::{
    guard::{caught, guarded, refused},
    meshes::mesh_of,
};

/// Time after which Ctrl-C is seen.
const BETWEEN_SIGNALS: Duration = Duration::from_millis(50);

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
    let (shown, mut seen) = mpsc::channel();
    let ended = Arc::new(AtomicBool::new(false));
    let started = start.is_some();
    // On a thread of its own, which ends at its next step: what comes before the first one takes seconds for a large mesh.
    let search = thread::spawn({
        let ended = ended.clone();
        move || {
            caught(move || {
                let search = PoseSearch::new(&mesh, camera);
                let search = if started { search.starting_at(&camera) } else { search };
                let steps = search.steps(&mask);
                let each = move |step: usize, loss: f64| {
                    anyhow::ensure!(!ended.load(Ordering::Relaxed), "the search was ended");
                    Ok(shown.send((step, steps, loss))?)
                };
                search.progress(each).run::<NdArray>(&mask).map_err(|error| format!("{error:#}"))
            })
        }
    });
    loop {
        let (step, again) = py.detach(move || (seen.recv_timeout(BETWEEN_SIGNALS), seen));
        seen = again;
        let visited = py.check_signals().and_then(|()| match (&visit, step) {
            (Some(visit), Ok(step)) => visit.call1(py, step).map(drop),
            _ => Ok(()),
        });
        if let Err(error) = visited {
            ended.store(true, Ordering::Relaxed);
            return Err(error);
        }
        if step == Err(RecvTimeoutError::Disconnected) {
            break;
        }
    }
    let found = py.detach(|| search.join()).map_err(|_| refused("the search has no result"))?;
    let poses = found.and_then(|found| found).map_err(refused)?;
    Ok(poses.iter().map(|pose| (pose.camera.rotation, pose.camera.translation, pose.iou)).collect())
}
