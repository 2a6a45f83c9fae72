//! Meshes from views, and colours on a mesh from pictures.

use anyhow::Context;
use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use softrast_inverse::{
    SolveConfig, paint_until_stopped,
    shape::{ShapeFit, ViewOfShape, fitting_hull},
};
use softrast_views::{PaintedView, View, frame_of_masks};

use crate::{
    guard::refused,
    meshes::{Parts, mesh_of, parts},
    views::{Camera, painted_of, views_of},
    watched::{Watch, watched},
};

/// A surface that has the masks of some views, and their normals and colours where they are given; and whether the search was not
/// interrupted. It starts at `start`, at the visual hull if `hull`, else at a sphere. `size` 0 stands for as many pixels as the views have.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python side names them")]
pub(crate) fn fit_mesh<'py>(
    py: Python<'py>,
    names: Vec<String>,
    masks: Vec<PyReadonlyArray2<'py, f32>>,
    cameras: Vec<Camera>,
    pictures: Option<Vec<PyReadonlyArray3<'py, f32>>>,
    normals: Option<Vec<PyReadonlyArray3<'py, f32>>>,
    start: Option<(PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, i64>)>,
    hull: bool,
    size: usize,
    steps: usize,
    most_faces: usize,
    smoothing: f64,
    visit: Option<Py<PyAny>>,
) -> PyResult<(Parts<'py>, bool)> {
    if !(smoothing > 0.0 && smoothing <= ShapeFit::SMOOTHEST) {
        let most = ShapeFit::SMOOTHEST;
        return Err(refused(format!(
            "smoothing is {smoothing}, expected more than 0, at most {most}"
        )));
    }
    let views = views_of(names, &masks, &cameras)?;
    let [colours, normals] = [pictures, normals]
        .map(|pictures| pictures.map(|pictures| painted_of(&views, &pictures)).transpose());
    let (colours, normals) = (colours?, normals?);
    let start = start.map(|(positions, faces)| mesh_of(&positions, &faces, None));
    let start = start.transpose()?;
    let work = move |watch: Watch| {
        let frame = frame_of_masks(&views)?;
        let framed = |view: &View| View { camera: frame.camera(&view.camera), ..view.clone() };
        let views: Vec<View> = views.iter().map(framed).collect();
        let of_view = |(k, view): (usize, &View)| {
            let mut of = ViewOfShape::of_mask(view)?;
            if let Some(colours) = &colours {
                of = of.with_colours(&colours[k]);
            }
            if let Some(normals) = &normals {
                of = of.with_normals(&normals[k]);
            }
            anyhow::Ok(of)
        };
        let of_views = views.iter().enumerate().map(of_view).collect::<anyhow::Result<_>>()?;
        let mut fit = ShapeFit::new(of_views)
            .with_steps(steps)
            .with_most_faces(most_faces)
            .with_smoothing(smoothing);
        if size > 0 {
            fit = fit.with_size(size);
        }
        match &start {
            Some(mesh) => fit = fit.starting_at(frame.mesh(mesh)),
            None if hull => {
                let hull = fitting_hull(&views).context("start=\"sphere\" needs no hull")?;
                fit = fit.starting_at(hull);
            }
            None => {}
        }
        let found = fit.progress(|step, loss| watch.step(step, steps, loss)).run()?;
        Ok(frame.mesh_to_world(&found.mesh)?)
    };
    let (mesh, interrupted) = watched(py, visit, true, work)?;
    Ok((parts(py, &mesh)?, !interrupted))
}

/// A mesh in the colours that some views show, its large faces cut into four; and whether the search was not interrupted.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python side names them")]
pub(crate) fn paint<'py>(
    py: Python<'py>,
    positions: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    names: Vec<String>,
    masks: Vec<PyReadonlyArray2<'py, f32>>,
    cameras: Vec<Camera>,
    pictures: Vec<PyReadonlyArray3<'py, f32>>,
    size: usize,
    steps: usize,
    learning_rate: f64,
    visit: Option<Py<PyAny>>,
) -> PyResult<(Parts<'py>, bool)> {
    let mesh = mesh_of(&positions, &faces, None)?;
    let views: Vec<PaintedView> = painted_of(&views_of(names, &masks, &cameras)?, &pictures)?;
    let config = SolveConfig { size, steps, learning_rate };
    let work = move |watch: Watch| {
        let each = |step: usize, loss| watch.step(step + 1, steps, loss);
        Ok(paint_until_stopped(&mesh, &views, &config, each)?.0)
    };
    let (mesh, interrupted) = watched(py, visit, true, work)?;
    Ok((parts(py, &mesh)?, !interrupted))
}
