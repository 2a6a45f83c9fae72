//! Files that lie beside a mesh: materials and pictures.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::{MeshError, bounded::read_bounded, texture::media_type};

/// Where the file lies that another one in `folder` calls `name`.
///
/// Nothing outside of the folder is opened: where a path leads out of it, its last part is looked for in the folder itself. So a path from
/// the machine on which a mesh was made does no harm.
pub(crate) fn beside(folder: &Path, name: &str) -> PathBuf {
    let parts: Vec<&str> = name.split(['/', '\\']).filter(|part| *part != ".").collect();
    let inside = |part: &&str| !(part.is_empty() || part.ends_with(':') || **part == *"..");
    let kept = if parts.iter().all(inside) { &parts[..] } else { &parts[parts.len() - 1..] };
    folder.join(kept.iter().filter(|part| inside(part)).collect::<PathBuf>())
}

/// Largest file that is read, in bytes: the longest that a GLB file can say.
const MOST_BYTES: u64 = u32::MAX as u64;

/// The content of a regular file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, MeshError> {
    read_bounded(path, MOST_BYTES).map_err(|reason| MeshError::Read { path: path.into(), reason })
}

/// The content of the picture that a file in `folder` calls `name`.
pub(crate) fn picture(folder: &Path, name: &str) -> Result<Vec<u8>, MeshError> {
    let path = beside(folder, name);
    let content = read(&path)?;
    if media_type(&content).is_none() {
        let reason = io::Error::other("it is neither a PNG nor a JPEG file");
        return Err(MeshError::Read { path, reason });
    }
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_leads_out_of_the_folder() {
        for (name, expected) in [
            ("a.png", "in/a.png"),
            ("./maps/a b.png", "in/maps/a b.png"),
            ("maps\\a.png", "in/maps/a.png"),
            ("../a.png", "in/a.png"),
            ("maps/../../../etc/passwd", "in/passwd"),
            ("/dev/zero", "in/zero"),
            ("C:\\me\\a.png", "in/a.png"),
            ("..", "in/"),
            ("", "in/"),
        ] {
            assert_eq!(beside(Path::new("in"), name), Path::new(expected), "{name}");
        }
    }
}
