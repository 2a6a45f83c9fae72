//! Reading a mesh, in the format that the name of its file ends in.

use std::{fs, io, path::Path};

use crate::{Mesh, MeshError, format::Format, glb, obj, ply, stl};

/// What a file has, before it is known to be a mesh.
#[derive(Default)]
pub(crate) struct Parts {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
    pub(crate) colours: Option<Vec<[f64; 3]>>,
}

impl Mesh {
    /// The mesh in the file at `path`: OBJ, PLY, STL or GLB by its ending; see [`Mesh::parse`].
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or cannot be read, or for the reasons of [`Mesh::parse`].
    pub fn load(path: impl AsRef<Path>) -> Result<Mesh, MeshError> {
        let path = path.as_ref();
        let unreadable = |reason| MeshError::Read { path: path.into(), reason };
        regular(path).map_err(unreadable)?;
        let name = path.display().to_string();
        // The ending comes before the bytes: a film may be large.
        let format = format_of(path, &name)?;
        format.parse(&fs::read(path).map_err(unreadable)?, &name)
    }

    /// The mesh in `bytes`, the content of a file called `name`.
    ///
    /// The name's ending, in any case, says the format: `.obj`, `.ply` (text, or binary in either
    /// order of bytes), `.stl` (text or binary) or `.glb` (binary glTF 2.0). Errors begin with the
    /// name.
    ///
    /// Of every format only positions, faces and colours of vertices are read: normals, texture
    /// coordinates, colours of faces, materials, lines and points are ignored, no other file is
    /// opened, and objects and groups are merged. Vertices keep their number and order, and degenerate faces stay. Polygons (OBJ, PLY)
    /// are cut into triangles by clipping ears, which keeps their winding and the area of concave
    /// ones. Numbers in text are read to 64 bits.
    ///
    /// STL files repeat each vertex for each triangle. Corners at equal coordinates, to the last
    /// bit and with -0 equal to 0, become one vertex, in the order of first use: so closed surfaces
    /// are closed.
    ///
    /// Of a GLB file all triangles, strips and fans of the default scene are read (of the first
    /// scene if none is the default, of all nodes if there is no scene), moved as their nodes say;
    /// where a node mirrors, the winding is turned. Each node brings a copy of its mesh's vertices.
    /// Skins, morph targets and animations are ignored: the mesh is as it is modelled.
    ///
    /// Colours are read as pictures and screens have them, from 0 to 1 (sRGB):
    ///
    /// - OBJ: `v x y z r g b`, from 0 to 1. A file where only some vertices have six numbers has no
    ///   colours.
    /// - PLY: the properties `red`, `green` and `blue` of the vertices, all three: whole numbers up to
    ///   255 (to 65535 as `ushort`), or floats from 0 to 1.
    /// - GLB: `COLOR_0`. Its numbers are linear, so they are converted; they are held to 0 to 1, as the
    ///   format asks, and transparency is ignored. Where only some parts have colours, the others are
    ///   white, which is what leaving them out means there.
    ///
    /// # Errors
    ///
    /// If the name has another ending, if there are no faces, or at the first part of the file
    /// that is not as its format says, such as a coordinate which is missing, not a number or not
    /// finite in 32 bits, a colour out of its range, an index which is out of range, a face with fewer
    /// than three corners, or an end that comes too early. Compressed GLB files, and those that need other files, are
    /// refused.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Mesh, MeshError> {
        format_of(Path::new(name), name)?.parse(bytes, name)
    }
}

impl Format {
    fn parse(self, bytes: &[u8], name: &str) -> Result<Mesh, MeshError> {
        let parsed = match self {
            Self::Obj => return obj::parse(bytes, name),
            Self::Ply => ply::parse(bytes),
            Self::Stl => stl::parse(bytes),
            Self::Glb => glb::parse(bytes),
        };
        let Parts { positions, faces, colours } =
            parsed.map_err(|trouble| trouble.of_file(name))?;
        let mesh = Mesh::new(positions, faces)?;
        match colours {
            Some(colours) => mesh.with_colours(colours),
            None => Ok(mesh),
        }
    }
}

fn format_of(path: &Path, name: &str) -> Result<Format, MeshError> {
    Format::of(path).ok_or_else(|| MeshError::UnknownFormat { name: name.to_owned() })
}

/// An error unless `path` is a regular file: reading a device could take for ever.
fn regular(path: &Path) -> io::Result<()> {
    if fs::metadata(path)?.is_file() {
        return Ok(());
    }
    Err(io::Error::other("it is a folder or a device, not a file"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_file_and_folder_are_errors_of_one_line() {
        for path in ["no/such/file.obj", env!("CARGO_MANIFEST_DIR"), "/dev/zero"] {
            let message = Mesh::load(path).unwrap_err().to_string();
            assert!(message.starts_with(&format!("{path}: cannot be read: ")), "{message}");
            assert_eq!(message.lines().count(), 1);
        }
    }
}
