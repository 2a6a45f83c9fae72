//! Softnesses that are learned for finding poses of a mesh.

use std::sync::{Arc, Mutex, PoisonError};

use numpy::PyReadonlyArray2;
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*};
use softrast_inverse::{
    InverseProblem, LearnConfig, Learning, Method, PoseProblem, ScheduledSoftness, SolveConfig,
};
use softrast_tensor::NdArray;

use crate::{
    meshes::mesh_of,
    softness::Softness,
    watched::{Watch, watched},
};

/// The best softness so far, and the errors of those that were validated.
type Learned = (ScheduledSoftness, Vec<f64>);

/// A softness that is learned on poses of a mesh, beginning with `softness`: runs of `steps` steps on `size` × `size` pixels, `updates` updates of
/// `batch` runs each. Also the mean validation error at the start and after each tenth of the updates, and whether it was not interrupted.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python side names them")]
pub(crate) fn learn_softness(
    py: Python<'_>,
    positions: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    softness: &Softness,
    size: usize,
    steps: usize,
    updates: usize,
    batch: usize,
    rate: f64,
    visit: Option<Py<PyAny>>,
) -> PyResult<(Softness, Vec<f64>, bool)> {
    let problem = PoseProblem::new(&mesh_of(&positions, &faces, None)?.normalized());
    let method = Method::new("learned", softness.0.clone());
    let latest: Arc<Mutex<Option<Learned>>> = Arc::default();
    let work = {
        let latest = latest.clone();
        move |watch: Watch| {
            let solve = SolveConfig { size, steps, ..problem.defaults() };
            let config = LearnConfig { updates, batch, outer_rate: rate, ..LearnConfig::default() };
            let mut learning = Learning::<_, NdArray>::new(problem, &method, &solve, &config)?;
            let mut errors = Vec::new();
            while let Some(record) = learning.step()? {
                errors.extend(record.validation_loss);
                let learned = (learning.learned().0, errors.clone());
                *latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(learned);
                let loss = record.loss.or(record.validation_loss).unwrap_or(f64::NAN);
                watch.step((record.step + 1).min(updates), updates, loss)?;
            }
            Ok((learning.learned().0, errors))
        }
    };
    // An update may take longer than somebody waits who pressed Ctrl-C.
    match watched(py, visit, false, work) {
        Ok(((softness, errors), _)) => Ok((Softness(softness), errors, true)),
        Err(error) if error.is_instance_of::<PyKeyboardInterrupt>(py) => {
            let latest = latest.lock().unwrap_or_else(PoisonError::into_inner).take();
            let (softness, errors) = latest.ok_or(error)?;
            Ok((Softness(softness), errors, false))
        }
        Err(error) => Err(error),
    }
}
