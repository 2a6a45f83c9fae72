//! COLMAP models, as text or binary: `cameras` and `images`.

use std::{
    collections::HashMap,
    io::{self, BufRead, BufReader, Read},
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};
use serde_json::{Map, Value};
use softrast_mesh::open_regular;
use softrast_raster::Pinhole;

use super::{
    Lens,
    fields::short,
    frame::Frame,
    rotation::{of_quaternion, to_quaternion},
};

/// Longest line of a camera or an image, in bytes.
const LONGEST_LINE: u64 = 1 << 16;

/// Names of camera models by number, and their parameters in order.
const MODELS: [(&str, &[&str]); 11] = [
    ("SIMPLE_PINHOLE", &["fx", "cx", "cy"]),
    ("PINHOLE", &["fx", "fy", "cx", "cy"]),
    ("SIMPLE_RADIAL", &["fx", "cx", "cy", "k1"]),
    ("RADIAL", &["fx", "cx", "cy", "k1", "k2"]),
    ("OPENCV", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]),
    ("OPENCV_FISHEYE", &["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"]),
    ("FULL_OPENCV", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]),
    ("FOV", &["fx", "fy", "cx", "cy", "omega"]),
    ("SIMPLE_RADIAL_FISHEYE", &["fx", "cx", "cy", "k1"]),
    ("RADIAL_FISHEYE", &["fx", "cx", "cy", "k1", "k2"]),
    (
        "THIN_PRISM_FISHEYE",
        &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"],
    ),
];

/// Cameras of a model by number, in the order of the file.
pub(super) type Lenses = Vec<(u32, Lens)>;

/// The pose of a camera in the format of COLMAP: the quaternion w, x, y, z of R, and t.
pub fn colmap_pose(camera: &Pinhole) -> [f64; 7] {
    let ([w, x, y, z], [tx, ty, tz]) = (to_quaternion(&camera.rotation), camera.translation);
    [w, x, y, z, tx, ty, tz]
}

/// Whether a folder contains the cameras of a model.
pub(super) fn is_in(folder: &Path) -> bool {
    ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file())
}

/// Cameras and images of a folder.
pub(super) struct Model {
    pub(super) lenses: Lenses,
    /// Empty if there is no file of images.
    pub(super) frames: Vec<Frame>,
    /// The file of the cameras, then that of the images if there is one.
    pub(super) files: Vec<PathBuf>,
}

/// The model in a folder. A binary file takes precedence over a text, as in COLMAP.
pub(super) fn load(folder: &Path) -> anyhow::Result<Model> {
    let file = |stem: &str| {
        let paths = ["bin", "txt"].map(|ending| folder.join(format!("{stem}.{ending}")));
        let binary = paths[0].is_file();
        paths.into_iter().find(|path| path.is_file()).map(|path| (path, binary))
    };
    let open = |path: &Path| {
        let open = || format!("cannot read the camera file {}", path.display());
        open_regular(path).map(BufReader::new).with_context(open)
    };
    let missing = || format!("{}: there is no cameras.bin or cameras.txt", folder.display());
    let (path, binary) = file("cameras").with_context(missing)?;
    let lenses = match binary {
        true => binary_lenses(open(&path)?),
        false => text_lenses(open(&path)?),
    };
    let lenses = lenses.with_context(|| path.display().to_string())?;
    let mut model = Model { lenses, frames: Vec::new(), files: vec![path] };
    if let Some((path, binary)) = file("images") {
        let by_number = model.lenses.iter().map(|(number, lens)| (*number, lens)).collect();
        let name = path.display().to_string();
        model.frames = match binary {
            true => binary_frames(open(&path)?, &by_number, &name)?,
            false => text_frames(open(&path)?, &by_number, &name)?,
        };
        ensure!(!model.frames.is_empty(), "{name}: there is no image");
        model.files.push(path);
    }
    Ok(model)
}

/// The cameras of a text.
pub(super) fn text_lenses(mut file: impl BufRead) -> anyhow::Result<Lenses> {
    let (mut lenses, mut number) = (Vec::new(), 0);
    while let Some(line) = next_line(&mut file, &mut number)? {
        let of = || {
            let mut words = line.split_whitespace();
            let id = words.next().and_then(|word| word.parse().ok()).context("no camera number")?;
            let name = words.next().context("no model")?;
            let numbers: Result<Vec<f64>, _> = words.map(str::parse).collect();
            let numbers = numbers.context("a parameter is no number")?;
            let [width, height, parameters @ ..] = &numbers[..] else { bail!("no size") };
            anyhow::Ok((id, lens(name, [*width, *height], parameters)?))
        };
        lenses.push(of().with_context(|| format!("line {number}"))?);
    }
    ensure!(!lenses.is_empty(), "there is no camera");
    Ok(lenses)
}

/// The images of a text called `name`. Every image has two lines, the second of which holds points.
pub(super) fn text_frames(
    mut file: impl BufRead,
    lenses: &HashMap<u32, &Lens>,
    name: &str,
) -> anyhow::Result<Vec<Frame>> {
    let (mut frames, mut number) = (Vec::new(), 0);
    while let Some(line) = next_line(&mut file, &mut number).with_context(|| name.to_owned())? {
        let of = || {
            // The name comes last and may contain spaces.
            let mut words = line.splitn(10, ' ');
            let mut word = || words.next().unwrap_or_default();
            let _id: u32 = word().parse().context("no image number")?;
            let mut pose = [0.0; 7];
            for value in &mut pose {
                *value = word().parse().context("fewer than seven numbers of a pose")?;
            }
            let camera = word().parse().context("no camera number")?;
            frame(words.next().context("no name")?, pose, camera, lenses)
        };
        frames.push(of().with_context(|| format!("{name}: line {number}"))?);
        let points = file.skip_until(b'\n').with_context(|| name.to_owned())?;
        number += usize::from(points > 0);
    }
    Ok(frames)
}

/// The next line with content, and its number; `None` after the last.
fn next_line(file: &mut impl BufRead, number: &mut usize) -> anyhow::Result<Option<String>> {
    loop {
        let mut line = Vec::new();
        file.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line)?;
        if line.is_empty() {
            return Ok(None);
        }
        *number += 1;
        ensure!((line.len() as u64) < LONGEST_LINE, "line {number} is too long");
        let line = String::from_utf8(line).with_context(|| format!("line {number}"))?;
        let line = line.trim_start_matches('\u{feff}').trim();
        if !line.is_empty() && !line.starts_with('#') {
            return Ok(Some(line.to_owned()));
        }
    }
}

/// The cameras of a binary file.
pub(super) fn binary_lenses(file: impl BufRead) -> anyhow::Result<Lenses> {
    let mut file = Binary(file);
    let count = file.count()?;
    let mut lenses = Vec::new();
    for _ in 0..count {
        let number = u32::from_le_bytes(file.take()?);
        let model = i32::from_le_bytes(file.take()?);
        let known = usize::try_from(model).ok().and_then(|model| MODELS.get(model));
        let (name, parameters) =
            known.with_context(|| format!("camera {number} has model number {model}"))?;
        let size = [file.count()?, file.count()?].map(|x| x as f64);
        let numbers: Vec<f64> =
            parameters.iter().map(|_| file.number()).collect::<anyhow::Result<_>>()?;
        lenses.push((number, lens(name, size, &numbers)?));
    }
    ensure!(!lenses.is_empty(), "there is no camera");
    Ok(lenses)
}

/// The images of a binary file called `name`.
pub(super) fn binary_frames(
    file: impl BufRead,
    lenses: &HashMap<u32, &Lens>,
    name: &str,
) -> anyhow::Result<Vec<Frame>> {
    let mut file = Binary(file);
    let count = file.count().with_context(|| name.to_owned())?;
    let mut frames = Vec::new();
    for k in 0..count {
        let mut of = || {
            let _id: [u8; 4] = file.take()?;
            let mut pose = [0.0; 7];
            for value in &mut pose {
                *value = file.number()?;
            }
            let camera = u32::from_le_bytes(file.take()?);
            let picture = file.text()?;
            // x and y as f64, and the number of a point.
            let points = file.count()?;
            file.skip(points.saturating_mul(24))?;
            frame(&picture, pose, camera, lenses)
        };
        frames.push(of().with_context(|| format!("{name}: image {k}"))?);
    }
    Ok(frames)
}

/// The lens of a model with these parameters.
fn lens(model: &str, [width, height]: [f64; 2], parameters: &[f64]) -> anyhow::Result<Lens> {
    let known = MODELS.iter().find(|(name, _)| *name == model);
    let (_, names) =
        known.with_context(|| format!("the camera model {} is not known", short(model)))?;
    ensure!(
        names.len() == parameters.len(),
        "{model} has {} parameters, and here are {}",
        names.len(),
        parameters.len()
    );
    ensure!(parameters.iter().all(|x| x.is_finite()), "a parameter is not finite");
    let mut fields: Map<String, Value> =
        names.iter().zip(parameters).map(|(name, &x)| (name.to_string(), x.into())).collect();
    fields.insert("w".to_owned(), width.into());
    fields.insert("h".to_owned(), height.into());
    fields.insert("camera_model".to_owned(), model.into());
    Lens::of(&fields.into())
}

/// An image with a quaternion and t, from world to camera.
fn frame(
    picture: &str,
    [w, x, y, z, translation @ ..]: [f64; 7],
    camera: u32,
    lenses: &HashMap<u32, &Lens>,
) -> anyhow::Result<Frame> {
    let of = || {
        let lens = lenses.get(&camera).with_context(|| format!("there is no camera {camera}"))?;
        let rotation = of_quaternion([w, x, y, z])?;
        anyhow::Ok(Frame {
            picture: picture.to_owned(),
            mask: None,
            lens: (*lens).clone(),
            rotation,
            translation,
            off: 0.0,
        })
    };
    of().with_context(|| short(picture))
}

/// A binary file with little-endian numbers.
struct Binary<R>(R);

impl<R: BufRead> Binary<R> {
    fn take<const N: usize>(&mut self) -> anyhow::Result<[u8; N]> {
        let mut taken = [0; N];
        self.0.read_exact(&mut taken).context("the file is cut off")?;
        Ok(taken)
    }

    fn count(&mut self) -> anyhow::Result<u64> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn number(&mut self) -> anyhow::Result<f64> {
        Ok(f64::from_le_bytes(self.take()?))
    }

    /// A zero-terminated text.
    fn text(&mut self) -> anyhow::Result<String> {
        let mut text = Vec::new();
        self.0.by_ref().take(LONGEST_LINE).read_until(0, &mut text)?;
        ensure!(text.pop() == Some(0), "the file is cut off");
        String::from_utf8(text).context("a name is no text in UTF-8")
    }

    fn skip(&mut self, count: u64) -> anyhow::Result<()> {
        let skipped = io::copy(&mut self.0.by_ref().take(count), &mut io::sink())?;
        ensure!(skipped == count, "the file is cut off");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use softrast_raster::ImageSize;

    use super::*;

    const CAMERAS: &str = "# Camera list\n1 OPENCV 200 150 220 222 104.5 71.75 -0.15 0.04 0.002 -0.0015\n7 SIMPLE_PINHOLE 64 48 50 32 24\n";
    const IMAGES: &str = "# Image list\n3 0.6 0.8 0 0 1 2 3 7 a b/00.png\n1 2 -1 3 4 -1\n4 2 0 0 0 0 0 4 1 01.png\n\n";

    fn by_number(lenses: &Lenses) -> HashMap<u32, &Lens> {
        lenses.iter().map(|(number, lens)| (*number, lens)).collect()
    }

    /// `CAMERAS` and `IMAGES` as binary files.
    fn binary() -> [Vec<u8>; 2] {
        let mut cameras = 2u64.to_le_bytes().to_vec();
        for (number, model, size, parameters) in [
            (
                1u32,
                4i32,
                [200u64, 150],
                &[220.0, 222.0, 104.5, 71.75, -0.15, 0.04, 0.002, -0.0015f64][..],
            ),
            (7, 0, [64, 48], &[50.0, 32.0, 24.0]),
        ] {
            cameras.extend(number.to_le_bytes());
            cameras.extend(model.to_le_bytes());
            cameras.extend(size.iter().flat_map(|x| x.to_le_bytes()));
            cameras.extend(parameters.iter().flat_map(|x| x.to_le_bytes()));
        }
        let mut images = 2u64.to_le_bytes().to_vec();
        for (number, pose, camera, name, points) in [
            (3u32, [0.6, 0.8, 0.0, 0.0, 1.0, 2.0, 3.0f64], 7u32, "a b/00.png", 2u64),
            (4, [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0], 1, "01.png", 0),
        ] {
            images.extend(number.to_le_bytes());
            images.extend(pose.iter().flat_map(|x| x.to_le_bytes()));
            images.extend(camera.to_le_bytes());
            images.extend(name.bytes().chain([0]));
            images.extend(points.to_le_bytes());
            images.extend(vec![9; 24 * points as usize]);
        }
        [cameras, images]
    }

    #[test]
    fn text_and_binary_say_the_same() {
        let [cameras, images] = binary();
        let lenses = text_lenses(CAMERAS.as_bytes()).unwrap();
        assert_eq!(lenses, binary_lenses(&cameras[..]).unwrap());
        let frames = text_frames(IMAGES.as_bytes(), &by_number(&lenses), "images.txt").unwrap();
        let same = binary_frames(&images[..], &by_number(&lenses), "images.bin").unwrap();
        assert_eq!(frames, same);
        assert_eq!(frames[0].picture, "a b/00.png");
        assert_eq!(frames[0].translation, [1.0, 2.0, 3.0]);
        // A rotation about x by an angle whose half has cosine .6 and sine .8.
        let expected = [[1.0, 0.0, 0.0], [0.0, -0.28, -0.96], [0.0, 0.96, -0.28]];
        for (row, expected) in frames[0].rotation.iter().zip(expected) {
            assert!((0..3).all(|k| (row[k] - expected[k]).abs() < 1e-12), "{row:?}");
        }
        // Quaternions of any length are normalised.
        assert_eq!(frames[1].rotation, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let size = ImageSize { height: 150, width: 200 };
        let (camera, bent) = frames[1].lens.camera(size).unwrap();
        assert_eq!((camera.focal, camera.centre), ([220.0, 222.0], [104.5, 71.75]));
        assert!(bent.is_some());
        let size = ImageSize { height: 48, width: 64 };
        let (camera, bent) = frames[0].lens.camera(size).unwrap();
        assert_eq!((camera.focal, bent), ([50.0, 50.0], None));
    }

    #[test]
    fn what_is_broken_is_one_line() {
        for (text, part) in [
            ("", "there is no camera"),
            ("1 WHAT 3 4 5\n", "line 1: the camera model WHAT is not known"),
            ("# a\n1 PINHOLE 3 4 5\n", "line 2: PINHOLE has 4 parameters, and here are 1"),
            ("1 PINHOLE 3 4 5 NaN 7 8\n", "not finite"),
            ("x", "no camera number"),
        ] {
            let error = format!("{:#}", text_lenses(text.as_bytes()).unwrap_err());
            assert!(error.contains(part) && error.lines().count() == 1, "{text}: {error}");
        }
        let lenses = text_lenses(CAMERAS.as_bytes()).unwrap();
        for (text, part) in [
            ("1 1 0 0 0 0 0 4 9 a.png\n", "i: line 1: a.png: there is no camera 9"),
            ("1 0 0 0 0 0 0 4 1 a.png\n", "quaternion"),
            ("1 1 0 0\n", "seven numbers"),
            ("1 1 0 0 0 0 0 4 1\n", "no name"),
        ] {
            let error = text_frames(text.as_bytes(), &by_number(&lenses), "i").unwrap_err();
            let error = format!("{error:#}");
            assert!(error.contains(part) && error.lines().count() == 1, "{text}: {error}");
        }
        let [cameras, images] = binary();
        for end in 0..cameras.len() {
            assert!(binary_lenses(&cameras[..end]).is_err());
        }
        for end in 0..images.len() {
            assert!(binary_frames(&images[..end], &by_number(&lenses), "i").is_err());
        }
    }
}
