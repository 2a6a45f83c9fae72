//! Reading an OBJ file.

use std::{fs, io, path::Path};

use crate::{Mesh, MeshError, clean::clean, polygon::triangles};

impl Mesh {
    /// The mesh in the OBJ file at `path`; see [`Mesh::parse`].
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or cannot be read, or for the reasons of [`Mesh::parse`].
    pub fn load(path: impl AsRef<Path>) -> Result<Mesh, MeshError> {
        let path = path.as_ref();
        let bytes = read(path).map_err(|reason| MeshError::Read { path: path.into(), reason })?;
        Self::parse(&bytes, &path.display().to_string())
    }

    /// The mesh in `bytes`, the content of an OBJ file; `name` is what errors call it.
    ///
    /// Vertices keep their number and order. Polygons are cut into triangles by clipping ears,
    /// which keeps their winding and the area of concave ones; degenerate faces stay. Objects and
    /// groups are merged. Materials are never opened; normals, texture coordinates, colours,
    /// lines and points are ignored.
    ///
    /// # Errors
    ///
    /// If there are no faces, or at the first line that has a coordinate which is missing, not a
    /// number or not finite in 32 bits, an index which is not a number or out of range, or a face
    /// with fewer than three corners.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Mesh, MeshError> {
        let clean = clean(bytes, name)?;
        // The parser numbers vertices as faces first use them. A first polygon that lists them
        // all keeps the order of the file, and those which no face uses.
        let all: String = (1..=clean.vertices).map(|vertex| format!(" {vertex}")).collect();
        let text = format!("f{all}\n{}", clean.text);
        let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
        let options = tobj::LoadOptions::default();
        let (models, _) =
            tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials).map_err(|reason| {
                MeshError::Parser { name: name.to_owned(), reason: reason.to_string() }
            })?;

        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for tobj::Model { mesh, .. } in models {
            positions.extend(mesh.positions.as_chunks().0);
            let polygons = split(&mesh.indices, &mesh.face_arities);
            faces.extend(polygons.skip(1).flat_map(|corners| triangles(&positions, corners)));
        }
        Self::new(positions, faces)
    }
}

/// The bytes of a regular file: reading a device could take for ever.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is a folder or a device, not a file"));
    }
    fs::read(path)
}

/// The polygons of a parsed model; no `arities` means that all are triangles.
fn split<'a>(mut indices: &'a [u32], arities: &'a [u32]) -> impl Iterator<Item = &'a [u32]> {
    let mut arities = arities.iter();
    std::iter::from_fn(move || {
        let corners = arities.next().map_or(3, |&n| n as usize);
        let (polygon, rest) = indices.split_at_checked(corners)?;
        indices = rest;
        Some(polygon)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_keep_the_order_of_the_file() {
        for count in 1..6 {
            let lines = (0..count).map(|x| format!("v {x} 0.1 0\n")).collect::<String>();
            let mesh = Mesh::parse(format!("{lines}f -1 1 1").as_bytes(), "a.obj").unwrap();
            let expected = (0..count).map(|x| [f64::from(x), 0.1, 0.0]).collect::<Vec<_>>();
            assert_eq!(mesh.positions(), expected);
            assert_eq!(mesh.faces(), [[count - 1, 0, 0]]);
        }
    }

    #[test]
    fn missing_file_and_folder_are_errors_of_one_line() {
        for path in ["no/such/file.obj", env!("CARGO_MANIFEST_DIR"), "/dev/zero"] {
            let message = Mesh::load(path).unwrap_err().to_string();
            assert!(message.starts_with(&format!("{path}: cannot be read: ")), "{message}");
            assert_eq!(message.lines().count(), 1);
        }
    }
}
