use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail, ensure};
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::{Value, json};
use softrast_mesh::Mesh;
use softrast_raster::{
    HostBackend, ImageSize, Pinhole, Pinholes, hard_silhouette, project_pinhole, vertices,
};
use softrast_softness::numbers;

use crate::Picture;

/// Intrinsics of a camera as files have them.
///
/// Focal lengths as `fl_x` and `fl_y`, as `fx` and `fy`, as the matrix `K`, or as the field of view `camera_angle_x` in radians; `cx` and
/// `cy`, else the middle; the size of its pictures as `w` and `h` or `width` and `height`. See [`Pinhole`] for what they mean.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct Lens {
    #[serde(alias = "fx")]
    fl_x: Option<f64>,
    #[serde(alias = "fy")]
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    #[serde(rename = "K")]
    matrix: Option<[[f64; 3]; 3]>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    #[serde(alias = "width")]
    w: Option<f64>,
    #[serde(alias = "height")]
    h: Option<f64>,
    camera_model: Option<String>,
    #[serde(flatten)]
    distortion: Distortion,
}

/// By name, or as the list that OpenCV returns.
#[derive(Clone, Debug, Default, Deserialize)]
struct Distortion {
    #[serde(alias = "dist", alias = "dist_coeffs", alias = "distortion_coefficients")]
    distortion: Option<Value>,
    is_fisheye: Option<bool>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// Models of cameras without distortion, or whose distortion is told by coefficients.
const MODELS: [&str; 4] = ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL"];

impl Lens {
    /// What a camera file says of it; a `transforms.json` is one, and so is a result of ours.
    ///
    /// # Errors
    ///
    /// If the file is missing, is no JSON, has a field of another type, or tells no focal length.
    pub fn load(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let path = path.as_ref();
        let of_result = json::<Held>(path)?.camera;
        let lens = match of_result {
            Some(lens) => lens,
            None => json(path)?,
        };
        lens.angle_or_length().with_context(|| path.display().to_string())?;
        Ok(lens)
    }

    /// A lens with this whole field of view along the shorter side of an image, in degrees, and square pixels.
    pub fn of_fov(fov_deg: f64, size: ImageSize) -> Self {
        let focal = size.shorter() as f64 / (2.0 * (fov_deg / 2.0).to_radians().tan());
        Self { fl_x: Some(focal), ..Self::default() }
    }

    /// The camera with this lens for pictures of this size, at the origin, looking along z.
    ///
    /// # Errors
    ///
    /// If it is for pictures of another size, has a skew, a distortion or no focal length.
    pub fn pinhole(&self, size: ImageSize) -> anyhow::Result<Pinhole> {
        let found = [size.width as f64, size.height as f64];
        if let (Some(w), Some(h)) = (self.w, self.h) {
            ensure!(
                [w, h] == found,
                "the camera is for pictures of {w} x {h} pixels, and this one has {} x {}: give the picture that the camera was calibrated \
                 for, or scale fx, fy, cx and cy",
                size.width,
                size.height
            );
        }
        self.check_distortion()?;
        let angle = |angle: f64, pixels: f64| pixels / (2.0 * (angle / 2.0).tan());
        let (focal, centre) = match (self.matrix, self.fl_x) {
            (_, Some(fx)) => ([fx, self.fl_y.unwrap_or(fx)], [None, None]),
            (Some([[fx, skew, cx], [below, fy, cy], last]), None) => {
                ensure!(
                    [below, last[0], last[1], last[2]] == [0.0, 0.0, 0.0, 1.0],
                    "K is no camera matrix: below its diagonal must be zeros, and its last row [0, 0, 1]; is it transposed?"
                );
                ensure!(
                    skew.abs() <= 1e-9 * fx.abs(),
                    "K has a skew of {skew}, which is not supported: rectify the picture"
                );
                ([fx, fy], [Some(cx), Some(cy)])
            }
            (None, None) => {
                self.angle_or_length()?;
                let along_x = self.camera_angle_x.map(|x| angle(x, found[0]));
                let along_y = self.camera_angle_y.map(|y| angle(y, found[1]));
                let either = along_x.or(along_y).unwrap_or(f64::NAN);
                ([along_x.unwrap_or(either), along_y.unwrap_or(either)], [None, None])
            }
        };
        let middle = |k: usize| found[k] / 2.0;
        let pinhole = Pinhole {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            translation: [0.0; 3],
            focal,
            centre: [
                self.cx.or(centre[0]).unwrap_or(middle(0)),
                self.cy.or(centre[1]).unwrap_or(middle(1)),
            ],
            size,
        };
        pinhole.check()?;
        Ok(pinhole)
    }

    fn angle_or_length(&self) -> anyhow::Result<()> {
        let told = [self.fl_x, self.camera_angle_x, self.camera_angle_y];
        ensure!(
            self.matrix.is_some() || told.iter().any(Option::is_some),
            "there is no focal length: name fx and fy in pixels (or fl_x and fl_y, K, camera_angle_x)"
        );
        Ok(())
    }

    fn check_distortion(&self) -> anyhow::Result<()> {
        let Distortion { distortion, is_fisheye, k1, k2, k3, k4, p1, p2 } = &self.distortion;
        let listed = distortion.as_ref().and_then(first_not_zero);
        let fisheye = is_fisheye.and_then(|is| is.then_some(1.0));
        let named = [
            ("k1", *k1),
            ("k2", *k2),
            ("k3", *k3),
            ("k4", *k4),
            ("p1", *p1),
            ("p2", *p2),
            ("distortion", listed),
            ("is_fisheye", fisheye),
        ];
        if let Some((name, value)) =
            named.iter().find_map(|&(name, x)| Some((name, x.filter(|&x| x != 0.0)?)))
        {
            bail!(
                "the lens distorts ({name} = {value}), which is not supported: undistort the pictures first, as with colmap \
                 image_undistorter or OpenCV's cv2.undistort"
            );
        }
        if let Some(model) = self.camera_model.as_deref().filter(|model| !MODELS.contains(model)) {
            bail!(
                "the camera model {model} is not supported: undistort the pictures to PINHOLE first, as with colmap image_undistorter"
            );
        }
        Ok(())
    }

    /// The lens of a frame that says so much of its own.
    fn with(&self, frame: &Self) -> Self {
        // Focal lengths belong together, however they are told.
        let focal = if frame.angle_or_length().is_ok() { frame } else { self };
        Self {
            cx: frame.cx.or(self.cx),
            cy: frame.cy.or(self.cy),
            w: frame.w.or(self.w),
            h: frame.h.or(self.h),
            camera_model: frame.camera_model.clone().or(self.camera_model.clone()),
            distortion: frame.distortion.or(&self.distortion),
            ..focal.clone()
        }
    }
}

impl Distortion {
    fn or(&self, other: &Self) -> Self {
        Self {
            distortion: self.distortion.clone().or(other.distortion.clone()),
            is_fisheye: self.is_fisheye.or(other.is_fisheye),
            k1: self.k1.or(other.k1),
            k2: self.k2.or(other.k2),
            k3: self.k3.or(other.k3),
            k4: self.k4.or(other.k4),
            p1: self.p1.or(other.p1),
            p2: self.p2.or(other.p2),
        }
    }
}

/// A number that is not zero among those of a list, or of lists in it.
fn first_not_zero(value: &Value) -> Option<f64> {
    match value {
        Value::Array(values) => values.iter().find_map(first_not_zero),
        _ => value.as_f64().filter(|&x| x != 0.0),
    }
}

/// A result of ours holds its camera one level down.
#[derive(Deserialize)]
struct Held {
    camera: Option<Lens>,
}

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
        transform_matrix: Option<[[f64; 4]; 4]>,
        camera: Option<Box<Pose>>,
    }
    let path = path.as_ref();
    let whole: Pose = json(path)?;
    let pose = whole.camera.map_or_else(
        || (whole.rotation, whole.t, whole.transform_matrix),
        |inner| (inner.rotation, inner.t, inner.transform_matrix),
    );
    let unit = |rotation, translation| Pinhole {
        rotation,
        translation,
        focal: [1.0; 2],
        centre: [0.0; 2],
        size: 1.into(),
    };
    let camera = match pose {
        (Some(rotation), Some(translation), _) => unit(rotation, translation),
        (.., Some(matrix)) => Pinhole::from_opengl(&matrix, [1.0; 2], [0.0; 2], 1),
        _ => bail!("{}: there is no pose: name R and t, or transform_matrix", path.display()),
    };
    camera.check().with_context(|| path.display().to_string())?;
    Ok((camera.rotation, camera.translation))
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

/// The hard silhouette that a camera sees of a mesh: its pixels, row by row from the top.
pub fn silhouette_pixels(mesh: &Mesh, camera: &Pinhole) -> Vec<f64> {
    let device = Default::default();
    let corners = vertices::<HostBackend>(mesh.positions(), &device);
    let seen = project_pinhole(corners, &Pinholes::new(&[*camera], &device));
    numbers(hard_silhouette(seen, mesh.faces(), camera.size))
}

/// Overlap over union of a silhouette and a mask with as many pixels; a pixel of the mask is in from one half on. 1 if both are empty.
pub fn mask_iou(silhouette: &[f64], mask: &Picture) -> f64 {
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
    /// Its mask.
    pub mask: Picture,
    /// Who took it.
    pub camera: Pinhole,
}

/// The views of a folder with a `transforms.json`, as instant-ngp and nerfstudio write it; `load` reads a mask.
///
/// It names `fl_x, fl_y, cx, cy, w, h` or `camera_angle_x` for all frames or for each, and `frames` with `file_path` and `transform_matrix`
/// (camera to world; x right, y up, z behind). A path without an ending is that of a PNG.
///
/// # Errors
///
/// If a file is missing or cannot be read, there is no frame, or a camera is none: one line that names the file and the frame.
pub fn load_views(
    folder: impl AsRef<Path>,
    load: impl Fn(&Path) -> anyhow::Result<Picture>,
) -> anyhow::Result<Vec<View>> {
    #[derive(Deserialize)]
    struct Transforms {
        #[serde(flatten)]
        lens: Lens,
        frames: Vec<Frame>,
    }
    #[derive(Deserialize)]
    struct Frame {
        #[serde(flatten)]
        lens: Lens,
        file_path: String,
        transform_matrix: Vec<Vec<f64>>,
    }
    let folder = folder.as_ref();
    let path = folder.join("transforms.json");
    let Transforms { lens, frames } = json(&path)?;
    ensure!(!frames.is_empty(), "{}: there is no frame", path.display());
    let view = |(k, frame): (usize, Frame)| {
        let name = frame.file_path;
        let here = || format!("{}: frame {k} ({name})", path.display());
        let rows: Option<Vec<[f64; 4]>> =
            frame.transform_matrix.iter().map(|row| row.as_slice().try_into().ok()).collect();
        let rows = rows.filter(|rows| rows.len() == 3 || rows.len() == 4);
        let rows = rows.with_context(|| format!("{}: transform_matrix is not 4 x 4", here()))?;
        let last = rows.get(3).copied().unwrap_or([0.0, 0.0, 0.0, 1.0]);
        ensure!(
            last == [0.0, 0.0, 0.0, 1.0],
            "{}: the last row of transform_matrix is {last:?}, not [0, 0, 0, 1]: is it transposed?",
            here()
        );
        let matrix = [rows[0], rows[1], rows[2], last];
        let mask = load(&picture_path(folder, &name)).with_context(here)?;
        let Pinhole { focal, centre, size, .. } =
            lens.with(&frame.lens).pinhole(mask.size()).with_context(here)?;
        let camera = Pinhole::from_opengl(&matrix, focal, centre, size);
        camera.check().with_context(here)?;
        Ok(View { name, mask, camera })
    };
    frames.into_iter().enumerate().map(view).collect()
}

fn picture_path(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    match path.extension() {
        Some(_) => path,
        None => path.with_extension("png"),
    }
}

fn json<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the camera file {}", path.display()))?;
    serde_json::from_str(&text).map_err(|error| match not_finite(&text) {
        Some(reason) => anyhow!("{}: {reason}", path.display()),
        None => anyhow!("{}: {error}", path.display()),
    })
}

/// What some programs write into JSON, which has no word for it, and where.
fn not_finite(text: &str) -> Option<String> {
    let words = ["-Infinity", "Infinity", "NaN"];
    let read = words.iter().fold(text.to_owned(), |text, word| text.replace(word, "null"));
    let whole: Value = serde_json::from_str(&read).ok().filter(|_| read != text)?;
    let frames = whole["frames"].as_array();
    let first = frames.and_then(|all| all.iter().position(|one| one.to_string().contains("null")));
    Some(match first {
        Some(k) => format!(
            "frame {k} has a number that is NaN or infinite: leave the frame out, or calibrate anew"
        ),
        None => "a number is NaN or infinite: calibrate anew".to_owned(),
    })
}
