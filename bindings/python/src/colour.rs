//! Soft colours of one mesh topology.

use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use softrast_raster::{ImageSize, Weighting};
use softrast_softness::DepthSoftness;
use softrast_tensor::NdArray;

use crate::{
    checks::{check_size, check_tolerance, corners, least},
    function::Function,
    guard::{guarded, refused},
    passes::Blends,
    softness::Softness,
};

/// A renderer of images in colours: everything except vertices, attributes, background and φ.
#[pyclass(frozen, module = "softrast._native")]
pub(crate) struct ColourRenderer {
    renderer: Arc<softrast_raster::ColourRenderer>,
    faces: Arc<[[u32; 3]]>,
    size: [usize; 2],
    log_weight: f64,
}

#[pymethods]
impl ColourRenderer {
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        faces: PyReadonlyArray2<'_, i64>,
        size: [usize; 2],
        softness: &Softness,
        planes: [f64; 2],
        progress: f64,
        depth: &str,
        depth_scale: f64,
        tolerance: f64,
        cull_back_faces: bool,
    ) -> PyResult<Self> {
        check_tolerance(tolerance)?;
        check_size(size)?;
        if !(planes[0] < planes[1] && planes.iter().all(|plane| plane.is_finite())) {
            return Err(refused(format!(
                "the planes are {planes:?}, expected a near depth and a larger far one"
            )));
        }
        if !(depth_scale > 0.0 && depth_scale.is_finite()) {
            return Err(refused(format!(
                "the scale of the depth softness is {depth_scale}, expected a positive number"
            )));
        }
        if softness.0.surrogate.is_some() {
            return Err(refused(
                "this softness has a surrogate, which only silhouettes use: take Softness.with_phi(softness.phi_at(progress)) for colours",
            ));
        }
        let depth: DepthSoftness = depth.parse().map_err(refused)?;
        let phi = softness.parameters_at(progress, size[0].min(size[1]))?;
        let weighting = Weighting { edge: softness.0.softness, depth, planes };
        let faces = corners(&faces)?;
        let of = || {
            let phi = [phi, depth.default_phi(depth_scale)];
            let (faces, size) = (faces.clone(), ImageSize::from(size));
            let renderer =
                softrast_raster::ColourRenderer::with_weighting(faces, size, weighting, phi)
                    .with_tolerance(tolerance);
            let renderer = if cull_back_faces { renderer.without_back_faces() } else { renderer };
            let behind = renderer.background::<NdArray<f64>>(&[], &Default::default());
            (renderer, behind.log_weight.into_scalar())
        };
        let (renderer, log_weight) = guarded(py, of)?;
        Ok(Self { renderer: Arc::new(renderer), faces, size, log_weight })
    }

    /// This renderer for other faces, with its knots and tables where they serve.
    fn with_faces(&self, py: Python<'_>, faces: PyReadonlyArray2<'_, i64>) -> PyResult<Self> {
        let faces = corners(&faces)?;
        let renderer = guarded(py, || self.renderer.with_faces(faces.clone()))?;
        Ok(Self { renderer: Arc::new(renderer), faces, ..*self })
    }

    /// Parameters φ of the softness by edge, `[P]`, float64: those that are drawn with where no others are given.
    #[getter]
    fn phi<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.renderer.phi()[0])
    }

    /// Parameters φ of the softness by depth, `[Q]`, float64: those that are drawn with where no others are given.
    #[getter]
    fn phi_depth<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.renderer.phi()[1])
    }

    /// Logarithm of the weight of a background that is given none: a thousandth of a face at the far plane.
    #[getter]
    fn log_weight(&self) -> f64 {
        self.log_weight
    }

    /// Height and width of the image, in pixels.
    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.size[0], self.size[1])
    }

    /// The largest error of a pixel under φ beside a background that is given no weight, as a part of the range of what is shown: the
    /// tolerance, or more where no table can follow a softness to it.
    #[getter]
    fn error_bound(&self, py: Python<'_>) -> PyResult<f64> {
        guarded(py, || {
            let behind = self.renderer.background::<NdArray<f64>>(&[], &Default::default());
            self.renderer.error_bound(&behind)
        })
    }

    /// How many faces there are.
    #[getter]
    fn face_count(&self) -> usize {
        self.faces.len()
    }

    /// How many vertices the faces ask for.
    #[getter]
    fn least_vertices(&self) -> usize {
        least(&self.faces)
    }

    fn __repr__(&self) -> String {
        let ([height, width], weighting) = (self.size, self.renderer.weighting());
        let (edge, depth, count) = (weighting.edge.family, weighting.depth, self.faces.len());
        format!(
            "ColourRenderer({height} x {width} pixels, {count} faces, {edge} by edge, {depth} by depth)"
        )
    }

    /// The function from vertices `[views, 3, V]`, attributes `[1 or views, entries, numbers]`, both φ in a row `[P + Q]`, a background with the
    /// logarithm of its weight `[channels + 1]` and, if there is one, a texture `[texels, 4]` to images `[views, channels + 1, height, width]`.
    /// `entries` `[F, 3]` say which entry of the attributes each corner has, and are those of the vertices where None is given. `texture` has its
    /// rows and columns.
    #[pyo3(signature = (entries, texture))]
    fn blend(
        &self,
        entries: Option<PyReadonlyArray2<'_, i64>>,
        texture: Option<[usize; 2]>,
    ) -> PyResult<Function> {
        let entries =
            entries.map_or_else(|| Ok(self.faces.clone()), |entries| corners(&entries))?;
        if entries.len() != self.faces.len() {
            return Err(refused(format!(
                "corners must have a row for each of the {} faces, found {}",
                self.faces.len(),
                entries.len()
            )));
        }
        let (renderer, faces) = (self.renderer.clone(), self.faces.clone());
        Ok(Function::blend(Blends::new(renderer, faces, entries, self.size, texture)))
    }
}
