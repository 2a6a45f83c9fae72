use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use softrast_raster::Pinhole;

use super::{
    Lens, colmap,
    fields::{self, check_place, read},
    frame::{Frame, frame_place},
    names::{find_mask, is_called, picture_path},
    transforms,
};
use crate::{Picture, View};

/// Camera files of a folder in order of precedence, and folders with a COLMAP model, which come after the first file.
const FILES: [&str; 2] = ["transforms.json", "transforms_train.json"];
const MODELS: [&str; 6] = ["", "sparse/0", "sparse", "colmap", "colmap/sparse/0", "colmap/sparse"];

/// Cameras in a file or a folder, before pictures are opened.
///
/// - `transforms.json` of instant-ngp and nerfstudio: `fl_x, fl_y, cx, cy, w, h` or `camera_angle_x` for all frames or per frame, and
///   `frames` with `file_path` and `transform_matrix` (camera to world; x right, y up, z behind). `mask_path` is the mask of a frame.
/// - A COLMAP model: `cameras.bin` and `images.bin`, or `.txt`.
/// - A single [`Lens`].
///
/// ```
/// use softrast_views::{CameraFile, Picture};
///
/// let json = r#"{"camera_angle_x": 0.8, "w": 8, "h": 8, "frames": [{"file_path": "a.png",
///     "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]}]}"#;
/// let file = CameraFile::parse(json.as_bytes(), "transforms.json")?;
/// let views = file.views(None, |_mask| Ok(Picture::new(vec![1.0; 64], 8)))?;
/// assert_eq!((&*views[0].name, views[0].camera.eye()), ("a.png", [0.0, 0.0, 3.0]));
/// assert_eq!(file.lens_of("a.png".as_ref())?.pinhole(8.into())?.focal, views[0].camera.focal);
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Debug)]
pub struct CameraFile {
    /// The file, for errors.
    name: String,
    files: Vec<PathBuf>,
    /// Lenses without a frame.
    lenses: Vec<Lens>,
    frames: Vec<Frame>,
    /// Folders that picture names may be relative to.
    roots: Vec<PathBuf>,
    note: Option<String>,
}

impl CameraFile {
    /// The cameras in a file; for a folder those of its `transforms.json`, else of the COLMAP model in it, in `sparse/0`, `sparse` or
    /// `colmap`, else of its `transforms_train.json`.
    ///
    /// # Errors
    ///
    /// If there is none, or one cannot be read or is invalid: one line with the file and the frame.
    pub fn load(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let path = path.as_ref();
        if path.is_dir() {
            return Self::of_folder(path);
        }
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        if ending.is_some_and(|ending| ending == "txt" || ending == "bin") {
            return Self::of_model(path.parent().unwrap_or(Path::new("")));
        }
        let (bytes, name) = read(path)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self {
            files: vec![path.to_owned()],
            roots: vec![folder],
            ..Self::parse(&bytes, &name)?
        })
    }

    fn of_folder(folder: &Path) -> anyhow::Result<Self> {
        let [first, last] = FILES.map(|name| folder.join(name));
        if first.is_file() {
            return Self::load(first);
        }
        let models = MODELS.map(|model| folder.join(model));
        if let Some(model) = models.iter().find(|model| colmap::is_in(model)) {
            return Self::of_model(model);
        }
        ensure!(
            last.is_file(),
            "{}: there are no cameras: transforms.json (instant-ngp, nerfstudio), cameras.bin or cameras.txt (COLMAP; also in sparse/0 or \
             colmap), and transforms_train.json are looked for",
            folder.display()
        );
        Self::load(last)
    }

    fn of_model(folder: &Path) -> anyhow::Result<Self> {
        let colmap::Model { lenses, frames, files } = colmap::load(folder)?;
        let name = files.last().unwrap_or(&folder.to_owned()).display().to_string();
        let lenses = lenses.into_iter().map(|(_, lens)| lens).collect();
        // A model is next to its pictures, or one or two folders deeper.
        let above = folder.ancestors().take(4).map(Path::to_owned);
        let roots = above.flat_map(|above| [above.join("images"), above]).collect();
        Ok(Self { name, files, lenses, frames, roots, note: None })
    }

    /// The cameras in the content of a file called `name`: JSON, or a calibration of OpenCV or ROS in YAML.
    ///
    /// # Errors
    ///
    /// If it is neither, has neither a focal length nor frames, or has a frame without a file or with an invalid pose.
    pub fn parse(bytes: &[u8], name: &str) -> anyhow::Result<Self> {
        let file = fields::json(bytes, name)?;
        let (lens, frames, note) = match file["frames"].is_null() {
            false => transforms::parse(bytes, name)?,
            true => (Lens::parse(bytes, name)?, Vec::new(), None),
        };
        let (files, roots) = (Vec::new(), Vec::new());
        Ok(Self { name: name.to_owned(), files, lenses: vec![lens], frames, roots, note })
    }

    /// The files that were read.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// A note on the world of the frames, in one line: a `transforms.json` may declare that it was rotated or scaled (`applied_transform`).
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// The mask of a picture, from its frame or from a folder `masks` next to it; `None` if there is no such frame or mask.
    pub fn mask_of(&self, picture: &Path) -> Option<PathBuf> {
        let file = picture.canonicalize().ok()?;
        let is =
            |frame: &&Frame| self.file(&frame.picture).canonicalize().ok().as_ref() == Some(&file);
        self.frames.iter().find(is).and_then(|frame| self.mask_beside(frame))
    }

    /// The lens of a picture: that of the frame with this picture or mask; or the only lens, if there is just one.
    ///
    /// # Errors
    ///
    /// If there is none, or there are several and not exactly one frame has this picture.
    pub fn lens_of(&self, picture: &Path) -> anyhow::Result<Lens> {
        let files = |frame: &&Frame| {
            [Some(frame.picture.clone()), frame.mask.clone()].into_iter().flatten()
        };
        let called = |frame: &&Frame| files(frame).any(|name| is_called(picture, &name));
        let named: Vec<&Frame> = self.frames.iter().filter(called).collect();
        let file = picture.canonicalize().ok();
        let is = |frame: &&Frame| {
            files(frame).any(|name| file.is_some() && self.file(&name).canonicalize().ok() == file)
        };
        let lenses: Vec<&Lens> = match (named.iter().copied().find(is), &named[..]) {
            (Some(frame), _) => vec![&frame.lens],
            (None, []) if self.frames.is_empty() => self.lenses.iter().collect(),
            (None, []) => self.frames.iter().map(|frame| &frame.lens).collect(),
            (None, named) => named.iter().map(|frame| &frame.lens).collect(),
        };
        let first =
            *lenses.first().with_context(|| format!("{}: there is no camera", self.name))?;
        if lenses.iter().any(|lens| *lens != first) {
            bail!(
                "{}: it has several cameras, and {} frame has the name of {}: name the picture as its frame does, or give a file with its \
                 camera alone",
                self.name,
                if named.is_empty() { "no" } else { "more than one" },
                picture.display()
            );
        }
        Ok(first.clone())
    }

    /// The views of all frames. `masks` is a folder of masks with the names of their pictures; without it, the mask of a frame is used,
    /// else that in a folder `masks` next to the pictures, else the picture itself. `load` reads a mask.
    ///
    /// # Errors
    ///
    /// If there are no frames, a mask cannot be read, or a camera does not fit its picture: one line with the file and the frame.
    pub fn views(
        &self,
        masks: Option<&Path>,
        load: impl Fn(&Path) -> anyhow::Result<Picture>,
    ) -> anyhow::Result<Vec<View>> {
        ensure!(
            !self.frames.is_empty(),
            "{}: there are no frames: a camera alone does not say from where pictures were taken",
            self.name
        );
        let view = |(k, frame): (usize, &Frame)| {
            let view = || self.view(frame, masks, &load);
            view().with_context(|| frame_place(&self.name, k, &frame.picture))
        };
        self.frames.iter().enumerate().map(view).collect()
    }

    fn view(
        &self,
        frame: &Frame,
        masks: Option<&Path>,
        load: impl Fn(&Path) -> anyhow::Result<Picture>,
    ) -> anyhow::Result<View> {
        let Frame { rotation, translation, off, .. } = *frame;
        let picture = self.file(&frame.picture);
        let mask = match masks {
            Some(folder) => find_mask(folder, &frame.picture)
                .with_context(|| format!("no mask in {} has its name", folder.display()))?,
            None => self.mask_beside(frame).unwrap_or_else(|| picture.clone()),
        };
        let mask = load(&mask)?;
        let (camera, distortion) = frame.lens.camera(mask.whole_size())?;
        let camera = Pinhole { rotation, translation, ..camera };
        camera.check()?;
        check_place(translation)?;
        let camera = mask.camera(&camera);
        let mask = match &distortion {
            Some(distortion) => mask.undistorted(&camera, distortion),
            None => mask,
        };
        Ok(View { name: frame.picture.clone(), picture, mask, camera, distortion, off })
    }

    /// The mask of a frame, or the one in a folder `masks`.
    fn mask_beside(&self, frame: &Frame) -> Option<PathBuf> {
        let named = frame.mask.as_ref().map(|name| self.file(name));
        let folders = || self.roots.iter().map(|root| root.join("masks"));
        named.or_else(|| folders().find_map(|folder| find_mask(&folder, &frame.picture)))
    }

    /// The file of a name: the first that exists.
    fn file(&self, name: &str) -> PathBuf {
        let mut candidates = self.roots.iter().map(|root| picture_path(root, name));
        let first = candidates.next().unwrap_or_else(|| picture_path(Path::new(""), name));
        let more = candidates.find(|path| path.is_file() && !first.is_file());
        more.unwrap_or(first)
    }
}

/// The views of a folder, with cameras found as by [`CameraFile::load`], and their masks; `load` reads a mask.
///
/// A path may have the format of Windows, and may lead out of the folder, since only pictures are read. If no file exists for a name
/// without the extension of a picture, such as `frame.0001`, the extensions png, jpg, jpeg and gif are tried.
///
/// # Errors
///
/// If a file is missing or cannot be read, there is no frame, or a camera is invalid: one line with the file and the frame.
pub fn load_views(
    folder: impl AsRef<Path>,
    load: impl Fn(&Path) -> anyhow::Result<Picture>,
) -> anyhow::Result<Vec<View>> {
    CameraFile::load(folder)?.views(None, load)
}
