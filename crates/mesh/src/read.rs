//! Reading an OBJ file.

use std::{fs, io, path::Path};

use crate::{
    Mesh, MeshError,
    content::{Content, content},
    polygon::triangles,
};

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
        let Content { positions, polygons } = content(bytes, name)?;
        let faces = polygons.iter().flat_map(|corners| triangles(&positions, corners)).collect();
        Ok(Self::from_valid(positions, faces))
    }
}

/// The bytes of a regular file: reading a device could take for ever.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is a folder or a device, not a file"));
    }
    fs::read(path)
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
