//! Pictures with their masks and cameras, from files and from arrays.

use std::path::PathBuf;

use anyhow::Context;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use rayon::prelude::*;
use softrast_raster::{ImageSize, Pinhole};
use softrast_views::{
    CameraFile, MaskRules, PaintedView, Picture, View, find_mask, mask_iou, reading_notes,
};

use crate::{
    guard::{guarded, refused},
    meshes::mesh_of,
};

/// R row by row, t, and the focal lengths and the principal point in pixels from the corner of the picture.
pub(crate) type Camera = ([[f64; 3]; 3], [f64; 3], [f64; 4]);
/// Red, green, blue and opacity of all views, each `[height, width, 4]`.
type Pictures<'py> = Option<Vec<Bound<'py, PyArray3<f32>>>>;
/// Names, masks, pictures, pictures of normals, cameras, and notes on what was read.
type Loaded<'py> = (
    Vec<String>,
    Vec<Bound<'py, PyArray2<f32>>>,
    Pictures<'py>,
    Pictures<'py>,
    Vec<Camera>,
    Vec<String>,
);

/// Reads pictures with their masks and cameras from a folder, without what lenses did to them. `rules` are invert, threshold and label;
/// `normals` are other pictures of the same names in a folder.
#[pyfunction]
pub(crate) fn load_views<'py>(
    py: Python<'py>,
    path: PathBuf,
    masks: Option<PathBuf>,
    rules: (bool, Option<f64>, Option<u32>),
    pictures: bool,
    normals: Option<PathBuf>,
) -> PyResult<Loaded<'py>> {
    let (invert, threshold, label) = rules;
    let rules = MaskRules { invert, threshold, label };
    let read = || -> anyhow::Result<_> {
        let cameras = CameraFile::load(path)?;
        let load = |path: &std::path::Path| Picture::load_mask_by(&rules, path);
        let views = cameras.views(masks.as_deref(), load)?;
        let colours =
            pictures.then(|| views.par_iter().map(View::load_colours).collect()).transpose();
        let of_normals = |folder: PathBuf| -> anyhow::Result<Vec<[Picture; 4]>> {
            let of = |view: &View| {
                let name = view.picture.to_string_lossy();
                let picture = find_mask(&folder, &name).with_context(|| {
                    let folder = folder.display();
                    format!("{}: no picture in {folder} has the name of {name}", view.name)
                })?;
                View { picture, ..view.clone() }.load_colours()
            };
            views.par_iter().map(of).collect()
        };
        let colours: Option<Vec<[Picture; 4]>> = colours?;
        let normals = normals.map(of_normals).transpose()?;
        let note = cameras.note().map(str::to_owned);
        let notes: Vec<String> = note.into_iter().chain(reading_notes(&views)).collect();
        Ok((views, colours, normals, notes))
    };
    let (views, colours, normals, notes) =
        guarded(py, || read().map_err(|why| format!("{why:#}")))?.map_err(refused)?;
    let mask = |view: &View| {
        let ImageSize { height, width } = view.mask.size();
        PyArray1::from_slice(py, view.mask.pixels()).reshape([height, width])
    };
    let arrays = |all: Vec<[Picture; 4]>| all.iter().map(|one| array(py, one)).collect();
    Ok((
        views.iter().map(|view| view.name.clone()).collect(),
        views.iter().map(mask).collect::<PyResult<_>>()?,
        colours.map(arrays).transpose()?,
        normals.map(arrays).transpose()?,
        views.iter().map(|view| camera_of(&view.camera)).collect(),
        notes,
    ))
}

/// Overlap over union of the hard silhouette of a mesh and the mask of each view, both of all pixels.
#[pyfunction]
pub(crate) fn view_iou(
    py: Python<'_>,
    positions: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    masks: Vec<PyReadonlyArray2<'_, f32>>,
    cameras: Vec<Camera>,
) -> PyResult<Vec<f64>> {
    let mesh = mesh_of(&positions, &faces, None)?;
    let views = views_of(vec![String::new(); masks.len()], &masks, &cameras)?;
    let of = |view: &View| {
        let silhouette = softrast_inverse::silhouette_pixels(&mesh, &view.camera);
        mask_iou(&silhouette, &view.mask)
    };
    guarded(py, || views.par_iter().map(of).collect())
}

/// How near the colours of a mesh come to the picture of each view, in decibels; NaN where nothing can be compared.
#[pyfunction]
pub(crate) fn view_psnr(
    py: Python<'_>,
    positions: PyReadonlyArray2<'_, f64>,
    faces: PyReadonlyArray2<'_, i64>,
    colours: PyReadonlyArray2<'_, f64>,
    masks: Vec<PyReadonlyArray2<'_, f32>>,
    cameras: Vec<Camera>,
    pictures: Vec<PyReadonlyArray3<'_, f32>>,
) -> PyResult<Vec<f64>> {
    let mesh = mesh_of(&positions, &faces, Some(&colours))?;
    let views = views_of(vec![String::new(); masks.len()], &masks, &cameras)?;
    let painted = painted_of(&views, &pictures)?;
    let of = |view: &PaintedView| view.psnr(&mesh).unwrap_or(f64::NAN);
    guarded(py, || painted.iter().map(of).collect())
}

/// Views of masks `[height, width]` and cameras.
pub(crate) fn views_of(
    names: Vec<String>,
    masks: &[PyReadonlyArray2<'_, f32>],
    cameras: &[Camera],
) -> PyResult<Vec<View>> {
    let of = |((name, mask), camera): ((String, &PyReadonlyArray2<'_, f32>), &Camera)| {
        let levels = mask.as_array();
        let &[height, width] = levels.shape() else { unreachable!("two axes") };
        if height == 0 || width == 0 {
            return Err(refused(format!("the mask is [{height}, {width}], expected pixels")));
        }
        let mask = Picture::new(levels.iter().copied().collect(), width);
        let (rotation, translation, [fx, fy, cx, cy]) = *camera;
        let camera =
            Pinhole { rotation, translation, focal: [fx, fy], centre: [cx, cy], size: mask.size() };
        camera.check().map_err(|why| refused(format!("{name}: {why}")))?;
        Ok(View { name, picture: PathBuf::new(), mask, camera, distortion: None, off: 0.0 })
    };
    names.into_iter().zip(masks).zip(cameras).map(of).collect()
}

/// Views with red, green, blue and opacity `[height, width, 4]` of the size of their masks.
pub(crate) fn painted_of(
    views: &[View],
    pictures: &[PyReadonlyArray3<'_, f32>],
) -> PyResult<Vec<PaintedView>> {
    let of = |(view, picture): (&View, &PyReadonlyArray3<'_, f32>)| {
        let ImageSize { height, width } = view.mask.size();
        let levels = picture.as_array();
        if levels.shape() != [height, width, 4] {
            let (name, found) = (&view.name, levels.shape());
            return Err(refused(format!(
                "{name}: the picture is {found:?}, its mask [{height}, {width}]"
            )));
        }
        let channel = |k: usize| {
            let levels = levels.index_axis(numpy::ndarray::Axis(2), k);
            Picture::new(levels.iter().copied().collect(), width)
        };
        let painted = PaintedView::new(view.clone(), [0, 1, 2].map(channel), &channel(3));
        match painted.part.pixels().iter().any(|&part| part > 0.0) {
            true => Ok(painted),
            false => Err(refused(format!("{}: no pixel of the mask has a colour", view.name))),
        }
    };
    views.iter().zip(pictures).map(of).collect()
}

fn camera_of(camera: &Pinhole) -> Camera {
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
    (camera.rotation, camera.translation, [fx, fy, cx, cy])
}

/// `[height, width, 4]`.
fn array<'py>(py: Python<'py>, channels: &[Picture; 4]) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let ImageSize { height, width } = channels[0].size();
    let pixel = |k: usize| channels.each_ref().map(|channel| channel.pixels()[k]);
    let levels: Vec<f32> = (0..height * width).flat_map(pixel).collect();
    PyArray1::from_vec(py, levels).reshape([height, width, 4])
}
