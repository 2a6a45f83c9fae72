//! The formats of mesh files, determined by the extension.

use std::path::Path;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Obj,
    Ply,
    Stl,
    Glb,
    Gltf,
    Off,
}

impl Format {
    pub(crate) fn of(path: &Path) -> Option<Self> {
        match ending(path)?.as_str() {
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            "glb" => Some(Self::Glb),
            "gltf" => Some(Self::Gltf),
            "off" => Some(Self::Off),
            _ => None,
        }
    }
}

/// The extension of a file's name, in lower case.
pub(crate) fn ending(path: &Path) -> Option<String> {
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}
