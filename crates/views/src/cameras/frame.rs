use super::{Lens, fields::short};

/// A frame: names of its files, its lens, its pose from world to camera, and the deviation of its rotation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frame {
    pub(super) picture: String,
    pub(super) mask: Option<String>,
    pub(super) lens: Lens,
    pub(super) rotation: [[f64; 3]; 3],
    pub(super) translation: [f64; 3],
    pub(super) off: f64,
}

/// The place of an error: the frame of a file.
pub(super) fn frame_place(file: &str, k: usize, picture: &str) -> String {
    format!("{file}: frame {k} ({})", short(picture))
}
