use std::path::Path;

use anyhow::{Context, bail, ensure};
use serde::Deserialize;
use softrast_raster::Pinhole;

use super::{
    fields::{check_place, json, read, typed},
    rotation::{SAID, nearest},
};

/// The pose of a camera in a file.
///
/// ```
/// use softrast_views::PoseFile;
///
/// let json = br#"{"R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 4]}"#;
/// let pose = PoseFile::parse(json, "pose.json")?;
/// assert_eq!((pose.translation, pose.note), ([0.0, 0.0, 4.0], None));
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PoseFile {
    /// R, row by row, from world to camera axes, in the convention of OpenCV.
    pub rotation: [[f64; 3]; 3],
    /// t, in world units.
    pub translation: [f64; 3],
    /// A note for the user if R was rounded and was replaced by the nearest rotation.
    pub note: Option<String>,
}

impl PoseFile {
    /// R and t of a camera in a file: `{"R": .., "t": ..}` of OpenCV, `{"transform_matrix": ..}` of OpenGL, or either of them under
    /// `camera`, as in result files of this project.
    ///
    /// # Errors
    ///
    /// If the file is missing, is not JSON, has neither, or its matrix is not a rotation to a hundredth.
    pub fn load(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let (bytes, name) = read(path.as_ref())?;
        Self::parse(&bytes, &name)
    }

    /// The pose in the content of a file called `name`.
    ///
    /// # Errors
    ///
    /// The errors of [`PoseFile::load`], except those of reading.
    pub fn parse(bytes: &[u8], name: &str) -> anyhow::Result<Self> {
        #[derive(Deserialize)]
        struct Pose {
            #[serde(rename = "R")]
            rotation: Option<[[f64; 3]; 3]>,
            t: Option<[f64; 3]>,
            transform_matrix: Option<Vec<Vec<f64>>>,
        }
        let file = json(bytes, name)?;
        // Results of version 0.1 have the camera for the mesh in its file separately.
        let inside = ["camera_in_file", "camera"].into_iter().find(|name| file[name].is_object());
        let object = inside.map_or(&file, |name| &file[name]);
        let camera = || {
            let pose: Pose = typed(object)?;
            match (pose.rotation, pose.t, pose.transform_matrix) {
                (Some(rotation), Some(translation), _) => {
                    let (rotation, off) = nearest(rotation)?;
                    let (focal, centre, size) = ([1.0; 2], [0.0; 2], 1.into());
                    checked(Pinhole { rotation, translation, focal, centre, size }, off)
                }
                (.., Some(rows)) => {
                    let (matrix, off) = camera_to_world(&rows)?;
                    checked(Pinhole::from_opengl(&matrix, [1.0; 2], [0.0; 2], 1), off)
                }
                _ => bail!("there is no pose: name R and t, or transform_matrix"),
            }
        };
        let (camera, off) = camera().with_context(|| name.to_owned())?;
        let note = (off >= SAID).then(|| rounded_note(name, off, 1));
        Ok(Self { rotation: camera.rotation, translation: camera.translation, note })
    }
}

/// Note that a rotation was rounded, and the number of such rotations.
pub(crate) fn rounded_note(name: &str, off: f64, count: usize) -> String {
    let of = match count {
        1 => "its rotation is".to_owned(),
        count => format!("its rotation, as those of {} more, is", count - 1),
    };
    format!(
        "{name}: {of} rounded (R Rᵀ is off the identity by {off:.1e}): the nearest rotation is taken"
    )
}

fn checked(camera: Pinhole, off: f64) -> anyhow::Result<(Pinhole, f64)> {
    camera.check()?;
    check_place(camera.translation)?;
    Ok((camera, off))
}

/// A `transform_matrix` of 3 or 4 rows, with its rotation replaced by the nearest one, and the deviation of the original.
pub(crate) fn camera_to_world(rows: &[Vec<f64>]) -> anyhow::Result<([[f64; 4]; 4], f64)> {
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
    let (rotation, off) = nearest([x, y, z].map(|[a, b, c, _]| [a, b, c]))?;
    let row = |k: usize, place: f64| {
        let [a, b, c] = rotation[k];
        [a, b, c, place]
    };
    Ok(([row(0, x[3]), row(1, y[3]), row(2, z[3]), last], off))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<PoseFile, String> {
        PoseFile::parse(text.as_bytes(), "a.json").map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn a_rounded_rotation_is_taken_and_the_eye_stays_where_it_was() {
        let matrix = r#"{"transform_matrix": [[1, 0, 0, 7], [0, 0.692, 0.722, 3.08], [0, -0.722, 0.692, 2.855]]}"#;
        let pose = parse(matrix).unwrap();
        let [x, y, z] = pose.rotation;
        let eye = [0, 1, 2].map(|k| {
            -(x[k] * pose.translation[0] + y[k] * pose.translation[1] + z[k] * pose.translation[2])
        });
        assert!(eye.iter().zip([7.0, 3.08, 2.855]).all(|(a, b)| (a - b).abs() < 1e-12), "{eye:?}");
        let length = z.iter().map(|x| x * x).sum::<f64>();
        assert!((length - 1.0).abs() < 1e-12, "{z:?}");
        let note = pose.note.unwrap();
        assert!(note.starts_with("a.json: its rotation is rounded (R Rᵀ is off"), "{note}");
        let exact = parse(r#"{"R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 4]}"#).unwrap();
        assert_eq!(exact.note, None);
    }

    #[test]
    fn what_is_no_pose_is_one_line_that_says_what_to_do() {
        let with = |r: &str, t: &str| parse(&format!(r#"{{"R": {r}, "t": {t}}}"#)).unwrap_err();
        let (unit, near) = ("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "[0, 0, 4]");
        for (error, part) in [
            (with("[[1.02, 0, 0], [0, 1.02, 0], [0, 0, 1.02]]", near), "a rotation times 1.02000"),
            (with("[[1, 0.02, 0], [0, 1, 0], [0, 0, 1]]", near), "no rotation"),
            (with("[[-1, 0, 0], [0, 1, 0], [0, 0, 1]]", near), "mirrors"),
            (with("[[0, 0, 0], [0, 0, 0], [0, 0, 0]]", near), "no rotation"),
            (with("[[1e300, 0, 0], [0, 1e300, 0], [0, 0, 1e300]]", near), "no rotation"),
            (with(unit, "[0, 0, 1e40]"), "take other units"),
            (with(unit, "[0, 4]"), "a.json"),
            (parse("{}").unwrap_err(), "R and t"),
            (parse(r#"{"transform_matrix": [[1, 0], [0, 1]]}"#).unwrap_err(), "4 x 4"),
        ] {
            assert!(error.starts_with("a.json: ") && error.contains(part), "{part}: {error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
