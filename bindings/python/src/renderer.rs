//! Renderers: faces, image size, softness, T-conorm and tolerance.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softrast_raster::{
    HostBackend, Projected, SoftRenderer, TConorm,
    low_level::{Rasterizer, Silhouette},
};
use softrast_softness::{EdgeSoftness, Softness as _};
use softrast_tensor::{DType, Tensor, TensorData};

use crate::{
    checks::{check_phi, check_progress, check_size, check_tolerance, corners, least},
    guard::{guarded, refused},
    op::Op,
    softness::Softness,
};

/// A renderer of silhouettes: everything except vertices and φ. It chooses supports and knots.
#[pyclass(frozen, module = "softrast._native")]
pub(crate) struct Renderer {
    renderer: SoftRenderer<EdgeSoftness>,
    faces: usize,
    t_conorm: TConorm,
    least_vertices: usize,
    size: [usize; 2],
}

/// A renderer for one φ, with support and knots for it.
#[pyclass(frozen, module = "softrast._native")]
pub(crate) struct Prepared {
    silhouette: Silhouette<EdgeSoftness>,
    t_conorm: TConorm,
    parameters: usize,
    least_vertices: usize,
    size: [usize; 2],
}

#[pymethods]
impl Renderer {
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        faces: PyReadonlyArray2<'_, i64>,
        size: [usize; 2],
        softness: &Softness,
        progress: f64,
        tolerance: f64,
        t_conorm: &str,
        cull_back_faces: bool,
    ) -> PyResult<Self> {
        let t_conorm: TConorm = t_conorm.parse().map_err(refused)?;
        check_tolerance(tolerance)?;
        check_size(size)?;
        let faces = corners(&faces)?;
        let (least_vertices, count) = (least(&faces), faces.len());
        check_progress(progress)?;
        let rasterizer =
            Rasterizer { culls: cull_back_faces, tolerance, t_conorm, ..Rasterizer::new(size) };
        let renderer = guarded(py, || softness.0.renderer_at(progress, rasterizer, faces))?;
        Ok(Self { renderer, faces: count, t_conorm, least_vertices, size })
    }

    /// Parameters φ `[P]`, float64: those that are drawn with where no others are given.
    #[getter]
    fn phi<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.renderer.phi())
    }

    /// Height and width of the image, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.size[0], self.size[1])
    }

    /// The largest error of a pixel under φ, in coverage: the tolerance, or more where no table can follow the softness to it.
    #[getter]
    fn error_bound(&self, py: Python<'_>) -> PyResult<f64> {
        guarded(py, || self.renderer.error_bound::<HostBackend>())
    }

    /// How many vertices the faces ask for.
    #[getter]
    fn least_vertices(&self) -> usize {
        self.least_vertices
    }

    fn __repr__(&self) -> String {
        let ([height, width], faces) = (self.size, self.faces);
        let softness = self.renderer.softness().family;
        let felt = if self.renderer.surrogate().is_some() { ", with a surrogate" } else { "" };
        format!("Renderer({height} x {width} pixels, {faces} faces, {softness}{felt})")
    }

    /// Support and knots for `phi`.
    fn prepared(&self, py: Python<'_>, phi: Vec<f64>) -> PyResult<Prepared> {
        self.prepared_of(py, &self.renderer, &phi)
    }

    /// The surrogate, if the softness has one: its φ `[P]`, float64, and support and knots for it.
    #[allow(clippy::type_complexity)]
    fn surrogate<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<Option<(Bound<'py, PyArray1<f64>>, Prepared)>> {
        let Some(renderer) = self.renderer.surrogate() else { return Ok(None) };
        let prepared = self.prepared_of(py, renderer, renderer.phi())?;
        Ok(Some((PyArray1::from_slice(py, renderer.phi()), prepared)))
    }
}

impl Renderer {
    fn prepared_of(
        &self,
        py: Python<'_>,
        renderer: &SoftRenderer<EdgeSoftness>,
        phi: &[f64],
    ) -> PyResult<Prepared> {
        let softness = renderer.softness();
        let parameters = softness.parameters();
        check_phi("phi", softness.family.name(), parameters, phi)?;
        let silhouette = guarded(py, || renderer.prepared::<HostBackend>(phi))?;
        let &Self { t_conorm, least_vertices, size, .. } = self;
        Ok(Prepared { silhouette, t_conorm, parameters, least_vertices, size })
    }
}

#[pymethods]
impl Prepared {
    /// The op from vertices `[views, 3, V]` and a table to sums `[views, height, width]`.
    fn sum(&self) -> Op {
        Op::sum(&self.silhouette, self.least_vertices, self.size)
    }

    /// The op from φ `[P]` to a table `[rows, 4]`.
    fn table(&self) -> Op {
        Op::table(&self.silhouette, self.parameters)
    }

    /// The op from sums to coverage in [0, 1].
    fn coverage(&self) -> Op {
        Op::coverage(self.t_conorm)
    }

    /// Distances in NDC beyond which a pixel outside and inside sees a constant.
    #[getter]
    fn support(&self) -> (f64, f64) {
        let [outer, inner] = self.silhouette.profile().support();
        (outer, inner)
    }
}

/// Hard silhouettes `[views, height, width]`, float32: 1 where the centre of a pixel lies in a face, else 0. `vertices` is `[views, V, 3]`.
#[pyfunction]
pub(crate) fn hard_silhouette<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray3<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    size: [usize; 2],
) -> PyResult<Bound<'py, PyAny>> {
    let faces = corners(&faces)?;
    let shape = vertices.shape().to_vec();
    let values = vertices.as_array().iter().copied().collect::<Vec<_>>();
    let image = guarded(py, || {
        let data = TensorData::new(values, shape);
        let vertices = Tensor::<HostBackend, 3>::from_data(data, (&Default::default(), DType::F64));
        let image =
            softrast_raster::hard_silhouette(Projected::new(vertices), &faces, size).into_data();
        (image.shape.to_vec(), image.iter::<f32>().collect::<Vec<_>>())
    })?;
    Ok(PyArray1::from_vec(py, image.1).reshape(image.0)?.into_any())
}
