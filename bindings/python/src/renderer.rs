//! Renderers: faces, image size, softness, T-conorm and tolerance.

use std::sync::Arc;

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use softrast_raster::{
    HostBackend, Projected, TConorm,
    low_level::{PixelLoss, Rasterizer},
};
use softrast_tensor::{DType, Tensor, TensorData};

use crate::{
    checks::{check_progress, check_size, check_tolerance, corners, least},
    function::Function,
    guard::{guarded, refused},
    losses::Losses,
    passes::Silhouettes,
    softness::Softness,
};

/// A renderer of silhouettes: everything except vertices and φ. It chooses supports and knots.
#[pyclass(frozen, module = "softrast._native")]
pub(crate) struct Renderer {
    scene: Arc<Silhouettes>,
    faces: usize,
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
        let scene = || Silhouettes::new(renderer, t_conorm, least_vertices, size);
        let scene = py.detach(scene).map_err(refused)?;
        Ok(Self { scene: Arc::new(scene), faces: count })
    }

    /// This renderer for other faces, with its knots and tables where they serve.
    fn with_faces(&self, py: Python<'_>, faces: PyReadonlyArray2<'_, i64>) -> PyResult<Self> {
        let faces = corners(&faces)?;
        let (least_vertices, count) = (least(&faces), faces.len());
        let &Silhouettes { t_conorm, size, .. } = &*self.scene;
        let renderer = guarded(py, || self.scene.renderer.with_faces(faces))?;
        let scene = || Silhouettes::new(renderer, t_conorm, least_vertices, size);
        let scene = py.detach(scene).map_err(refused)?;
        Ok(Self { scene: Arc::new(scene), faces: count })
    }

    /// Parameters φ `[P]`, float64: those that are drawn with where no others are given.
    #[getter]
    fn phi<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.scene.renderer.phi())
    }

    /// Height and width of the image, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.scene.size.into()
    }

    /// The largest error of a pixel under φ, in coverage: the tolerance, or more where no table can follow the softness to it.
    #[getter]
    fn error_bound(&self, py: Python<'_>) -> PyResult<f64> {
        guarded(py, || self.scene.renderer.error_bound::<HostBackend>())
    }

    /// How many vertices the faces ask for.
    #[getter]
    fn least_vertices(&self) -> usize {
        self.scene.least_vertices
    }

    fn __repr__(&self) -> String {
        let ([height, width], faces) = (self.scene.size, self.faces);
        let renderer = &self.scene.renderer;
        let softness = renderer.softness().family;
        let surrogate = if renderer.surrogate().is_some() { ", with a surrogate" } else { "" };
        format!("Renderer({height} x {width} pixels, {faces} faces, {softness}{surrogate})")
    }

    /// The function from vertices `[views, 3, V]` and, unless it is the renderer's own, φ `[P]` to coverage `[views, height, width]`.
    fn silhouette(&self, own: bool) -> Function {
        Function::silhouette(self.scene.clone(), own)
    }

    /// The function from vertices `[views, 3, V]` and targets `[1 or views, height, width]` to the loss "mse" or "iou" of each view, if it has one.
    fn loss(&self, name: &str) -> PyResult<Option<Function>> {
        let loss = match name {
            "mse" => PixelLoss::SquaredError,
            "iou" => PixelLoss::Iou,
            _ => return Err(refused(format!("there is no loss {name}"))),
        };
        Ok(Losses::new(&self.scene, loss).map(Function::loss))
    }

    /// The surrogate, if the softness has one: its silhouettes `[views, height, width]` under its own φ.
    fn surrogate(&self, py: Python<'_>) -> PyResult<Option<Function>> {
        let &Silhouettes { t_conorm, least_vertices, size, .. } = &*self.scene;
        let Some(renderer) = self.scene.renderer.surrogate() else { return Ok(None) };
        let scene = || Silhouettes::new(renderer.clone(), t_conorm, least_vertices, size);
        let scene = py.detach(scene).map_err(refused)?;
        Ok(Some(Function::silhouette(Arc::new(scene), true)))
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
