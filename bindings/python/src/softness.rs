//! Softnesses: by name, from a file, or bundled.

use numpy::PyArray1;
use pyo3::prelude::*;
use softrast_inverse::ScheduledSoftness;
use softrast_softness::{EdgeSoftness, Family, Softness as _};

use crate::{
    checks::{check_phi, check_progress},
    guard::{guarded, refused},
};

/// The name that errors give in the place of a file.
const PICKLE: &str = "a pickled softness";

/// A soft step with its parameters φ: how much a face covers a pixel at a signed distance (NDC, positive inside).
///
/// `Softness("logistic", scale=0.01)` is a family at a scale in NDC; with `squared=True` it sees the signed square of the distance and the
/// scale is in NDC². One pixel is `2 / min(height, width)`. Names are those of `families()`. Raises `ValueError` for an unknown name or a
/// scale that is not positive.
#[pyclass(frozen, module = "softrast")]
pub(crate) struct Softness(pub(crate) ScheduledSoftness);

#[pymethods]
impl Softness {
    #[new]
    #[pyo3(signature = (family, scale, *, squared=false))]
    fn new(py: Python<'_>, family: &str, scale: f64, squared: bool) -> PyResult<Self> {
        let family = family.parse::<Family>().map_err(refused)?;
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(refused(format!(
                "the scale of a softness is {scale}, expected a positive number"
            )));
        }
        let softness =
            if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
        guarded(py, || Self(ScheduledSoftness::constant(softness, scale)))
    }

    /// A bundled softness that was learned on a task; `learned_names()` lists them.
    #[staticmethod]
    fn learned(name: &str) -> PyResult<Self> {
        ScheduledSoftness::learned(name).map(Self).map_err(refused)
    }

    /// Reads and checks a JSON file, as the command line writes them.
    #[staticmethod]
    fn load(py: Python<'_>, path: std::path::PathBuf) -> PyResult<Self> {
        guarded(py, || ScheduledSoftness::load(path))?.map(Self).map_err(refused)
    }

    /// Writes a JSON file at `path`, whole or not at all.
    fn save(&self, py: Python<'_>, path: std::path::PathBuf) -> PyResult<()> {
        guarded(py, || self.0.save(path))?.map_err(refused)
    }

    /// Its JSON text and what reads it, for pickle and copies.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = self.0.text(PICKLE).map_err(refused)?;
        Ok((py.get_type::<Self>().getattr("_parsed")?, (text,)))
    }

    /// The softness of a JSON text, for pickle.
    #[staticmethod]
    fn _parsed(text: &str) -> PyResult<Self> {
        ScheduledSoftness::parse(text, PICKLE).map(Self).map_err(refused)
    }

    /// This softness with other parameters, `[P]`, without a schedule and without a surrogate.
    fn with_phi(&self, phi: Vec<f64>) -> PyResult<Self> {
        let softness = self.0.softness;
        check_phi("phi", softness.family.name(), softness.parameters(), &phi).map_err(refused)?;
        let (schedule, adaptive, surrogate) = (None, None, None);
        Ok(Self(ScheduledSoftness { phi, schedule, adaptive, surrogate, ..self.0.clone() }))
    }

    /// Parameters φ `[P]`, float64, at `progress` of a run (0 to 1), on images whose shorter side has `size` pixels. A softness without a
    /// schedule has the same all along.
    #[pyo3(signature = (progress=0.0, size=64))]
    fn phi_at<'py>(
        &self,
        py: Python<'py>,
        progress: f64,
        size: usize,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.parameters_at(progress, size)?))
    }

    /// The name of the family.
    #[getter]
    fn family(&self) -> &'static str {
        self.0.softness.family.name()
    }

    /// Whether the family sees the signed square of the distance.
    #[getter]
    fn squared(&self) -> bool {
        self.0.softness.scale_is_squared()
    }

    /// Whether its gradient to vertices is that of another softness.
    #[getter]
    fn has_surrogate(&self) -> bool {
        self.0.surrogate.is_some()
    }

    /// The learning rate of the runs that it was learned on, if it was.
    #[getter]
    fn learning_rate(&self) -> Option<f64> {
        self.0.learning_rate
    }

    fn __repr__(&self) -> String {
        let squared = if self.squared() { ", squared" } else { "" };
        let surrogate = if self.0.surrogate.is_some() { ", with a surrogate" } else { "" };
        let moving = if self.0.is_constant() { "" } else { ", its scale moves over a run" };
        format!("Softness({}{squared}, φ [{}]{surrogate}{moving})", self.family(), self.0.phi.len())
    }
}

impl Softness {
    /// Parameters at `progress` of a run, on images whose shorter side has `size` pixels.
    pub(crate) fn parameters_at(&self, progress: f64, size: usize) -> PyResult<Vec<f64>> {
        check_progress(progress)?;
        Ok(self.0.phi_at(progress, size))
    }
}

/// The names of all families.
#[pyfunction]
pub(crate) fn families() -> Vec<&'static str> {
    Family::ALL.map(Family::name).to_vec()
}

/// The names of the bundled softnesses, for `Softness.learned`.
#[pyfunction]
pub(crate) fn learned_names() -> Vec<&'static str> {
    ScheduledSoftness::learned_names().collect()
}
