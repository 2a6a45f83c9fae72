//! Files that a mesh file refers to: materials and pictures.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::{MeshError, bounded::read_bounded, material::media_type};

/// Path of the file that another file in `folder` calls `name`.
///
/// No file outside of the folder is opened: if a path leads out of it, only its last component is used, in the folder itself. A path from
/// the machine on which a mesh was made is therefore harmless.
pub(crate) fn referenced_path(folder: &Path, name: &str) -> PathBuf {
    let parts: Vec<&str> = name.split(['/', '\\']).filter(|part| *part != ".").collect();
    let inside = |part: &&str| !(part.is_empty() || part.contains(':') || **part == *"..");
    let kept = if parts.iter().all(inside) { &parts[..] } else { &parts[parts.len() - 1..] };
    folder.join(kept.iter().filter(|part| inside(part)).collect::<PathBuf>())
}

/// Largest file that is read, in bytes: the longest that the header of a GLB file can state.
pub(crate) const MOST_BYTES: u64 = u32::MAX as u64;

/// The content of a regular file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, MeshError> {
    read_bounded(path, MOST_BYTES).map_err(|reason| MeshError::Read { path: path.into(), reason })
}

/// Path of the file that a URI in a file in `folder` refers to: `%20` stands for a space, but not all programs encode it.
pub(crate) fn referenced_uri(folder: &Path, uri: &str) -> PathBuf {
    let plain = referenced_path(folder, uri);
    if plain.exists() { plain } else { referenced_path(folder, &decoded(uri)) }
}

/// A text with its escapes decoded: `%` and two hexadecimal digits stand for a byte.
fn decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digits = after.get(..2).filter(|digits| digits.iter().all(u8::is_ascii_hexdigit));
        let byte =
            digits.and_then(|digits| u8::from_str_radix(str::from_utf8(digits).ok()?, 16).ok());
        let (byte, after) = match byte {
            Some(byte) if first == b'%' => (byte, &after[2..]),
            _ => (first, after),
        };
        bytes.push(byte);
        rest = after;
    }
    String::from_utf8(bytes).unwrap_or_else(|_| uri.to_owned())
}

/// The content of the picture called `name` in a file in `folder`.
pub(crate) fn picture(folder: &Path, name: &str) -> Result<Vec<u8>, MeshError> {
    picture_at(referenced_path(folder, name))
}

/// The content of the picture at `path`.
pub(crate) fn picture_at(path: PathBuf) -> Result<Vec<u8>, MeshError> {
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
    fn escapes_of_a_uri_are_bytes_and_lead_nowhere_else() {
        for (uri, expected) in [
            ("my%20mesh.bin", "in/my mesh.bin"),
            ("%C3%A4.bin", "in/ä.bin"),
            ("50%.bin", "in/50%.bin"),
            ("%FF.bin", "in/%FF.bin"),
            ("%2e%2e%2fa.bin", "in/a.bin"),
            ("%2", "in/%2"),
        ] {
            assert_eq!(referenced_uri(Path::new("in"), uri), Path::new(expected), "{uri}");
        }
    }

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
            assert_eq!(referenced_path(Path::new("in"), name), Path::new(expected), "{name}");
        }
    }
}
