//! Camera files: lenses, poses, and frames of many pictures.

mod calibration;
mod camera_file;
mod coefficients;
mod colmap;
mod distortion;
mod fields;
mod frame;
mod lens;
mod names;
mod pose_file;
mod rotation;
mod transforms;

pub use self::{
    camera_file::{CameraFile, load_views},
    colmap::colmap_pose,
    distortion::Distortion,
    lens::Lens,
    names::find_mask,
    pose_file::PoseFile,
};
pub(crate) use self::{pose_file::rounded_note, rotation::SAID};
