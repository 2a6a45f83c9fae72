//! `transforms.json`, as instant-ngp, nerfstudio and Blender's NeRF data write it.

use anyhow::{Context, ensure};
use serde::Deserialize;
use serde_json::Value;
use softrast_raster::Pinhole;

use super::{
    Lens,
    fields::{json, typed},
    frame::{Frame, frame_place},
    pose_file::camera_to_world,
};

/// The lens that stands outside of the frames, and the frames.
pub(super) fn parse(bytes: &[u8], name: &str) -> anyhow::Result<(Lens, Vec<Frame>)> {
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
    Ok((lens, frames))
}
