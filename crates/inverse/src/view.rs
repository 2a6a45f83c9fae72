use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use serde_json::{Value, json};
use softrast_mesh::Mesh;
use softrast_raster::{HostBackend, Pinhole, Pinholes, hard_silhouette, project_pinhole, vertices};
use softrast_softness::numbers;

use crate::{
    Frame, Lens, Picture,
    camera_file::{json, typed},
};

/// R and t of a camera in a file: `{"R": .., "t": ..}` as OpenCV has them, `{"transform_matrix": ..}` as OpenGL has it, or either of them
/// under `camera`, as a result of ours.
///
/// # Errors
///
/// If the file is missing, is no JSON, has neither, or what it has is no rotation.
pub fn load_pose(path: impl AsRef<Path>) -> anyhow::Result<([[f64; 3]; 3], [f64; 3])> {
    #[derive(Deserialize)]
    struct Pose {
        #[serde(rename = "R")]
        rotation: Option<[[f64; 3]; 3]>,
        t: Option<[f64; 3]>,
        transform_matrix: Option<Vec<Vec<f64>>>,
    }
    let path = path.as_ref();
    let file = json(path)?;
    let object = if file["camera"].is_object() { &file["camera"] } else { &file };
    let camera = || {
        let pose: Pose = typed(object)?;
        let unit = |rotation, translation| Pinhole {
            rotation,
            translation,
            focal: [1.0; 2],
            centre: [0.0; 2],
            size: 1.into(),
        };
        let camera = match (pose.rotation, pose.t, pose.transform_matrix) {
            (Some(rotation), Some(translation), _) => unit(rotation, translation),
            (.., Some(rows)) => {
                Pinhole::from_opengl(&camera_to_world(&rows)?, [1.0; 2], [0.0; 2], 1)
            }
            _ => bail!("there is no pose: name R and t, or transform_matrix"),
        };
        camera.check()?;
        anyhow::Ok(camera)
    };
    let camera = camera().with_context(|| path.display().to_string())?;
    Ok((camera.rotation, camera.translation))
}

/// A `transform_matrix` of 3 or 4 rows.
fn camera_to_world(rows: &[Vec<f64>]) -> anyhow::Result<[[f64; 4]; 4]> {
    let complete: Option<Vec<[f64; 4]>> =
        rows.iter().map(|row| row.as_slice().try_into().ok()).collect();
    let last = [0.0, 0.0, 0.0, 1.0];
    let [x, y, z, last] = match complete.as_deref() {
        Some(&[x, y, z]) => [x, y, z, last],
        Some(&[x, y, z, last]) => [x, y, z, last],
        _ => bail!("transform_matrix is not 4 x 4"),
    };
    ensure!(
        last == [0.0, 0.0, 0.0, 1.0],
        "the last row of transform_matrix is {last:?}, not [0, 0, 0, 1]: is it transposed?"
    );
    Ok([x, y, z, last])
}

/// A camera as JSON: R, t, K, width and height, and the orbit if there is one that sees the same.
pub fn camera_json(camera: &Pinhole) -> Value {
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
    let mut found = json!({
        "R": camera.rotation,
        "t": camera.translation,
        "K": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
        "width": camera.size.width,
        "height": camera.size.height,
    });
    if let Some(orbit) = camera.orbit() {
        found["orbit"] = json!({
            "distance": orbit.distance,
            "elevation_deg": orbit.elevation_deg,
            "azimuth_deg": orbit.azimuth_deg,
            "fov_deg": orbit.fov_deg,
        });
    }
    found
}

/// The hard silhouette that a camera sees of a mesh: its pixels, row by row from the top. Mesh and camera may be anywhere, in any unit.
pub fn silhouette_pixels(mesh: &Mesh, camera: &Pinhole) -> Vec<f64> {
    let device = Default::default();
    let frame = Frame::of_cameras(mesh, [camera]);
    let positions: Vec<[f64; 3]> = mesh.positions().iter().map(|&p| frame.point(p)).collect();
    let corners = vertices::<HostBackend>(&positions, &device);
    let seen = project_pinhole(corners, &Pinholes::new(&[frame.camera(camera)], &device));
    numbers(hard_silhouette(seen, mesh.faces(), camera.size))
}

/// Overlap over union of a silhouette and a mask with as many pixels; a pixel of the mask is in from one half on. 1 if both are empty.
///
/// # Panics
///
/// If they have not as many pixels.
pub fn mask_iou(silhouette: &[f64], mask: &Picture) -> f64 {
    assert_eq!(silhouette.len(), mask.pixels().len(), "pixels of the silhouette and the mask");
    let pairs = || silhouette.iter().zip(mask.pixels()).map(|(&a, &b)| (a > 0.5, b >= 0.5));
    let both = pairs().filter(|&(a, b)| a && b).count();
    let either = pairs().filter(|&(a, b)| a || b).count();
    if either == 0 { 1.0 } else { both as f64 / either as f64 }
}

/// A picture and the camera that took it.
#[derive(Clone, Debug)]
pub struct View {
    /// What the file calls it.
    pub name: String,
    /// The file of the picture.
    pub picture: PathBuf,
    /// Its mask.
    pub mask: Picture,
    /// Who took it.
    pub camera: Pinhole,
}

/// The views of a folder with a `transforms.json`, as instant-ngp and nerfstudio write it; `load` reads a mask.
///
/// It names `fl_x, fl_y, cx, cy, w, h` or `camera_angle_x` for all frames or for each, and `frames` with `file_path` and `transform_matrix`
/// (camera to world; x right, y up, z behind). A frame with a `mask_path` has its mask there. A path without an ending is that of a PNG.
///
/// # Errors
///
/// If a file is missing or cannot be read, there is no frame, or a camera is none: one line that names the file and the frame.
pub fn load_views(
    folder: impl AsRef<Path>,
    load: impl Fn(&Path) -> anyhow::Result<Picture>,
) -> anyhow::Result<Vec<View>> {
    #[derive(Deserialize)]
    struct Frame {
        file_path: String,
        mask_path: Option<String>,
        transform_matrix: Vec<Vec<f64>>,
    }
    let folder = folder.as_ref();
    let path = folder.join("transforms.json");
    let file = json(&path)?;
    let here = || path.display().to_string();
    let lens = Lens::of(&file).with_context(here)?;
    let frames = file["frames"].as_array();
    let frames = frames.with_context(|| format!("{}: frames is no list", path.display()))?;
    ensure!(!frames.is_empty(), "{}: there is no frame", path.display());
    let view = |(k, object): (usize, &Value)| {
        let name = object["file_path"].as_str().unwrap_or("without file_path").to_owned();
        let view = || {
            let frame: Frame = typed(object)?;
            let matrix = camera_to_world(&frame.transform_matrix)?;
            let picture = picture_path(folder, &frame.file_path);
            let mask = match frame.mask_path {
                Some(name) => load(&picture_path(folder, &name))?,
                None => load(&picture)?,
            };
            let lens = lens.with(&Lens::of(object)?);
            let Pinhole { focal, centre, size, .. } = lens.pinhole(mask.size())?;
            let camera = Pinhole::from_opengl(&matrix, focal, centre, size);
            camera.check()?;
            anyhow::Ok((picture, mask, camera))
        };
        let (picture, mask, camera) =
            view().with_context(|| format!("{}: frame {k} ({name})", path.display()))?;
        Ok(View { name, picture, mask, camera })
    };
    frames.iter().enumerate().map(view).collect()
}

fn picture_path(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    match path.extension() {
        Some(_) => path,
        None => path.with_extension("png"),
    }
}
