//! `transforms.json` of instant-ngp, nerfstudio and Blender's NeRF data.

use anyhow::{Context, ensure};
use serde::Deserialize;
use serde_json::Value;
use softrast_raster::Pinhole;

use super::{
    Lens,
    fields::{json, short, typed},
    frame::{Frame, frame_place},
    pose_file::camera_to_world,
};

/// The content of the file: the lens outside of the frames, the frames, and a note on their world.
pub(super) type Transforms = (Lens, Vec<Frame>, Option<String>);

/// The content of a file called `name`.
pub(super) fn parse(bytes: &[u8], name: &str) -> anyhow::Result<Transforms> {
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
            let Pinhole { rotation, translation, .. } =
                Pinhole::from_opengl(&pose, [1.0; 2], [0.0; 2], 1);
            let lens = lens.with(&Lens::of(object)?);
            let Fields { file_path: picture, mask_path: mask, .. } = fields;
            anyhow::Ok(Frame { picture, mask, lens, rotation, translation, off })
        };
        let called = object["file_path"].as_str().unwrap_or("without file_path");
        read().with_context(|| frame_place(name, k, called))
    };
    let frames = frames.iter().enumerate().map(frame).collect::<anyhow::Result<_>>()?;
    Ok((lens, frames, applied(&file).then(|| format!("{}: {APPLIED}", short(name)))))
}

const APPLIED: &str = "its world is not that of the reconstruction that it was made from, but turned or scaled (applied_transform, \
    applied_scale): what is found is in the world of this file";

/// Whether the world of the cameras was transformed when the file was written.
fn applied(file: &Value) -> bool {
    let entry = |row: usize, column: usize| file["applied_transform"][row][column].as_f64();
    let identity = |row: usize, column: usize| if row == column { 1.0 } else { 0.0 };
    let differs = |k: usize| entry(k / 4, k % 4).is_some_and(|x| x != identity(k / 4, k % 4));
    (0..12).any(differs) || file["applied_scale"].as_f64().is_some_and(|scale| scale != 1.0)
}

#[cfg(test)]
mod tests {
    use crate::CameraFile;

    #[test]
    fn a_world_that_was_turned_or_scaled_is_said_in_one_line() {
        let frames = r#""fx": 50, "frames": [{"file_path": "a.png", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}]"#;
        for (field, said) in [
            (r#""applied_transform": [[1,0,0,0],[0,0,1,0],[0,-1,0,0]],"#, true),
            (r#""applied_scale": 0.5,"#, true),
            (
                r#""applied_transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]], "applied_scale": 1.0,"#,
                false,
            ),
            (r#""applied_transform": "none","#, false),
            ("", false),
        ] {
            let file = CameraFile::parse(format!("{{{field}{frames}}}").as_bytes(), "t.json");
            let file = file.unwrap();
            assert_eq!(file.note().is_some(), said, "{field}");
            assert!(file.note().is_none_or(|note| note.starts_with("t.json: its world is not")));
        }
    }
}
