use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use serde::Deserialize;
use serde_json::Value;
use softrast_raster::Pinhole;

use crate::{
    Lens, Picture, View,
    camera_file::{check_place, json, read, typed},
    pose_file::camera_to_world,
};

/// Endings of picture files, as they are written.
const ENDINGS: [&str; 4] = ["png", "jpg", "jpeg", "gif"];

/// The cameras of a `transforms.json`, before pictures are opened.
#[derive(Clone, Debug)]
pub struct Transforms {
    /// The file, for errors.
    name: String,
    frames: Vec<Frame>,
}

/// A frame: names of its files, its lens, its pose from camera to world, and how far off its rotation was.
#[derive(Clone, Debug)]
struct Frame {
    picture: String,
    mask: Option<String>,
    lens: Lens,
    pose: [[f64; 4]; 4],
    off: f64,
}

impl Transforms {
    /// The cameras in a file.
    ///
    /// # Errors
    ///
    /// If it cannot be read, or those of [`Transforms::parse`].
    pub fn load(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let (bytes, name) = read(path.as_ref())?;
        Self::parse(&bytes, &name)
    }

    /// The cameras in the content of a file called `name`.
    ///
    /// # Errors
    ///
    /// If it is no JSON, there is no frame, or a frame has no file, or a pose that is none: one line that names the file and the frame.
    pub fn parse(bytes: &[u8], name: &str) -> anyhow::Result<Self> {
        #[derive(Deserialize)]
        struct Fields {
            file_path: String,
            mask_path: Option<String>,
            transform_matrix: Vec<Vec<f64>>,
        }
        let file = json(bytes, name)?;
        let lens = Lens::of(&file).with_context(|| name.to_owned())?;
        let frames = file["frames"].as_array();
        let frames = frames.with_context(|| format!("{name}: frames is no list"))?;
        ensure!(!frames.is_empty(), "{name}: there is no frame");
        let frame = |(k, object): (usize, &Value)| {
            let read = || {
                let fields: Fields = typed(object)?;
                let (pose, off) = camera_to_world(&fields.transform_matrix)?;
                let lens = lens.with(&Lens::of(object)?);
                let Fields { file_path: picture, mask_path: mask, .. } = fields;
                anyhow::Ok(Frame { picture, mask, lens, pose, off })
            };
            let called = object["file_path"].as_str().unwrap_or("without file_path");
            read().with_context(|| place(name, k, called))
        };
        let frames = frames.iter().enumerate().map(frame).collect::<anyhow::Result<_>>()?;
        Ok(Self { name: name.to_owned(), frames })
    }

    /// The views whose pictures are named from `folder` on; `load` reads a mask.
    ///
    /// # Errors
    ///
    /// If a picture cannot be read, or a camera is none for its picture: one line that names the file and the frame.
    pub fn views(
        &self,
        folder: &Path,
        load: impl Fn(&Path) -> anyhow::Result<Picture>,
    ) -> anyhow::Result<Vec<View>> {
        let view = |(k, frame): (usize, &Frame)| {
            let view = || {
                let picture = picture_path(folder, &frame.picture);
                let mask = match &frame.mask {
                    Some(name) => load(&picture_path(folder, name))?,
                    None => load(&picture)?,
                };
                let Pinhole { focal, centre, size, .. } = frame.lens.pinhole(mask.whole_size())?;
                let camera = Pinhole::from_opengl(&frame.pose, focal, centre, size);
                camera.check()?;
                check_place(camera.translation)?;
                let camera = mask.camera(&camera);
                anyhow::Ok(View {
                    name: frame.picture.clone(),
                    picture,
                    mask,
                    camera,
                    off: frame.off,
                })
            };
            view().with_context(|| place(&self.name, k, &frame.picture))
        };
        self.frames.iter().enumerate().map(view).collect()
    }
}

/// The views of a folder with a `transforms.json`, as instant-ngp and nerfstudio write it; `load` reads a mask.
///
/// It names `fl_x, fl_y, cx, cy, w, h` or `camera_angle_x` for all frames or for each, and `frames` with `file_path` and `transform_matrix`
/// (camera to world; x right, y up, z behind). A frame with a `mask_path` has its mask there.
///
/// A path may be written as on Windows, and may lead out of the folder: pictures are all that is read. Where no file has a name without an
/// ending, or with one of no picture, as `frame.0001`, the endings png, jpg, jpeg and gif are tried.
///
/// # Errors
///
/// If a file is missing or cannot be read, there is no frame, or a camera is none: one line that names the file and the frame.
pub fn load_views(
    folder: impl AsRef<Path>,
    load: impl Fn(&Path) -> anyhow::Result<Picture>,
) -> anyhow::Result<Vec<View>> {
    let folder = folder.as_ref();
    Transforms::load(folder.join("transforms.json"))?.views(folder, load)
}

fn place(file: &str, k: usize, picture: &str) -> String {
    format!("{file}: frame {k} ({picture})")
}

/// The file that a name in `transforms.json` means: the first that is there, or else the likeliest, for an error.
fn picture_path(folder: &Path, name: &str) -> PathBuf {
    let ending = |name: &str| name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
    let complete = ending(name).is_some_and(|ending| ENDINGS.contains(&&*ending));
    let mut candidates = Vec::new();
    for name in spellings(name) {
        candidates.push(folder.join(&name));
        if !complete {
            let endings =
                ENDINGS.iter().flat_map(|ending| [ending.to_string(), ending.to_uppercase()]);
            candidates.extend(endings.map(|ending| folder.join(format!("{name}.{ending}"))));
        }
    }
    let found = candidates.iter().position(|path| path.is_file());
    candidates.swap_remove(found.unwrap_or(usize::from(!complete)))
}

/// A name as it stands, with the separators of Windows replaced, and if it begins with a drive of Windows its ends, the longest first.
fn spellings(name: &str) -> Vec<String> {
    let mut names = vec![name.to_owned()];
    if name.contains('\\') {
        names.push(name.replace('\\', "/"));
    }
    if let [drive, b':', b'/' | b'\\', ..] = name.as_bytes()
        && drive.is_ascii_alphabetic()
    {
        let parts: Vec<&str> =
            name[3..].split(['/', '\\']).filter(|part| !part.is_empty()).collect();
        names.extend((0..parts.len()).map(|k| parts[k..].join("/")));
    }
    names
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn pictures_are_found_by_the_names_that_tools_and_windows_write() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("set");
        fs::create_dir_all(inside.join("images")).unwrap();
        for name in [
            "set/images/00.png",
            "set/images/r_01.5.png",
            "set/images/b.JPG",
            "set/images/plain",
            "set/images/c.jpeg",
            "beside.png",
        ] {
            fs::write(folder.path().join(name), b"").unwrap();
        }
        for (name, expected) in [
            ("images/00.png", "images/00.png"),
            ("./images/00", "images/00.png"),
            ("images\\00.png", "images/00.png"),
            (".\\images\\00", "images/00.png"),
            ("./images/r_01.5", "images/r_01.5.png"),
            ("images\\r_01.5", "images/r_01.5.png"),
            ("images/b", "images/b.JPG"),
            ("images/c", "images/c.jpeg"),
            ("images/plain", "images/plain"),
            ("../beside", "../beside.png"),
            ("..\\beside.png", "../beside.png"),
            ("D:\\scans\\set\\images\\00.png", "images/00.png"),
            ("C:/scans/images/r_01.5", "images/r_01.5.png"),
        ] {
            let found = picture_path(&inside, name);
            let expected = inside.join(expected);
            assert_eq!(found.canonicalize().unwrap(), expected.canonicalize().unwrap(), "{name}");
        }
        // What is not there is named as it most likely would be.
        assert!(picture_path(&inside, "images/no").ends_with("images/no.png"));
        assert!(picture_path(&inside, "images/no.png").ends_with("images/no.png"));
        assert!(picture_path(&inside, "").ends_with(".png"));
    }

    #[test]
    fn frames_are_read_from_bytes_and_errors_name_them() {
        let frame = r#"{"file_path": "a", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4]]}"#;
        let whole = format!(r#"{{"fl_x": 5, "frames": [{frame}, {frame}]}}"#);
        assert_eq!(Transforms::parse(whole.as_bytes(), "t.json").unwrap().frames.len(), 2);
        for (text, part) in [
            ("", "t.json: EOF"),
            ("[]", "a JSON object is expected"),
            ("{}", "frames is no list"),
            (r#"{"frames": []}"#, "there is no frame"),
            (r#"{"frames": [3]}"#, "frame 0 (without file_path)"),
            (r#"{"frames": [{"file_path": "b", "transform_matrix": [[2]]}]}"#, "frame 0 (b)"),
        ] {
            let error = format!("{:#}", Transforms::parse(text.as_bytes(), "t.json").unwrap_err());
            assert!(error.contains(part) && error.lines().count() == 1, "{text}: {error}");
        }
    }
}
