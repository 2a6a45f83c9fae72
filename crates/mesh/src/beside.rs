//! Files that lie beside a mesh: materials and pictures.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::{MeshError, bounded::read_bounded, material::media_type};

/// Where the file lies that another one in `folder` calls `name`.
///
/// Nothing outside of the folder is opened: where a path leads out of it, its last part is looked for in the folder itself. So a path from
/// the machine on which a mesh was made does no harm.
pub(crate) fn beside(folder: &Path, name: &str) -> PathBuf {
    let parts: Vec<&str> = name.split(['/', '\\']).filter(|part| *part != ".").collect();
    let inside = |part: &&str| !(part.is_empty() || part.contains(':') || **part == *"..");
    let kept = if parts.iter().all(inside) { &parts[..] } else { &parts[parts.len() - 1..] };
    folder.join(kept.iter().filter(|part| inside(part)).collect::<PathBuf>())
}

/// Largest file that is read, in bytes: the longest that a GLB file can say.
pub(crate) const MOST_BYTES: u64 = u32::MAX as u64;

/// The content of a regular file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, MeshError> {
    read_bounded(path, MOST_BYTES).map_err(|reason| MeshError::Read { path: path.into(), reason })
}

/// Where the file lies that a URI in a file in `folder` names: `%20` stands for a blank, but not all programs know.
pub(crate) fn beside_uri(folder: &Path, uri: &str) -> PathBuf {
    let plain = beside(folder, uri);
    if plain.exists() { plain } else { beside(folder, &decoded(uri)) }
}

/// A text without its escapes: `%` and two hexadecimal digits stand for a byte.
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

/// The content of the picture that a file in `folder` calls `name`.
pub(crate) fn picture(folder: &Path, name: &str) -> Result<Vec<u8>, MeshError> {
    picture_at(beside(folder, name))
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
            assert_eq!(beside_uri(Path::new("in"), uri), Path::new(expected), "{uri}");
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
            assert_eq!(beside(Path::new("in"), name), Path::new(expected), "{name}");
        }
    }
}
