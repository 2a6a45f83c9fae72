//! Reading a mesh, in the format that the name of its file ends in.

use std::path::Path;

use crate::{
    Mesh, MeshError, beside, bounded::open_regular, format::Format, glb, obj, off, parts::Parts,
    ply, stl,
};

impl Mesh {
    /// The mesh in the file at `path`: OBJ, PLY, STL, OFF, GLB or glTF by its ending; see [`Mesh::parse`]. Buffers of a GLB or glTF file may
    /// lie in other files in its folder or below it.
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or cannot be read, or for the reasons of [`Mesh::parse`].
    pub fn load(path: impl AsRef<Path>) -> Result<Mesh, MeshError> {
        let (bytes, name, format) = opened(path.as_ref())?;
        format.parse(&bytes, &name, Some(folder_of(path.as_ref())), false).map(|(mesh, _)| mesh)
    }

    /// The mesh in the file at `path` with its [`Texture`](crate::Texture), if it has one, otherwise as [`Mesh::load`]; and warnings.
    ///
    /// Colours, textures, pictures and materials never keep a mesh from being read. Each warning is one line about something that the file
    /// has and the mesh has not, or has otherwise: colours that are left out, scaled or clamped (see [`Mesh::parse`]), a texture or its
    /// picture that is left out, a library of materials that cannot be read, an extension of glTF that the file requires and that is not read.
    /// `Mesh::load` gives the same mesh but for the texture, without warnings.
    ///
    /// A texture lies on all faces of a mesh, and each face has the picture or the colour of its [`Material`](crate::Material). A texture is
    /// left out where corners that need a coordinate have none; where a picture cannot be had, coordinates stay. Other properties of materials
    /// are ignored, beyond 0 to 1 pictures always repeat.
    ///
    /// - OBJ: `vt` at the corners of faces, and `map_Kd` of the materials of `mtllib`; without it `Kd` as pictures and screens have it, unless
    ///   vertices have colours. Options of `map_Kd` are not read. A line `mtllib` names one library, or several that end in `.mtl`; names may
    ///   hold spaces.
    /// - GLB and glTF: `TEXCOORD_0` or `TEXCOORD_1`, whichever the base colour texture names, or the diffuse texture of
    ///   `KHR_materials_pbrSpecularGlossiness`; turned so that v is up. Its picture lies in the file, in a data URI, or in a file of its own.
    ///   Factors and colours of vertices multiply it, as the format has it.
    ///
    /// A mesh has up to 1000 pictures, of 1 GiB together.
    /// Pictures are PNG or JPEG. Libraries of materials lie in the folder of the mesh or below it, pictures in the folder of the mesh (GLB, glTF)
    /// or of the library (OBJ) or below it, and nothing else is opened: of a path that leads out of the folder the last part counts. Links in
    /// the folder are followed.
    ///
    /// # Errors
    ///
    /// Those of [`Mesh::load`].
    pub fn load_textured(path: impl AsRef<Path>) -> Result<(Mesh, Vec<MeshError>), MeshError> {
        let path = path.as_ref();
        let (bytes, name, format) = opened(path)?;
        format.parse(&bytes, &name, Some(folder_of(path)), true)
    }

    /// The mesh in `bytes`, the content of a file called `name`.
    ///
    /// The name's ending, in any case, says the format: `.obj`, `.ply` (text, or binary in either
    /// order of bytes), `.stl` (text or binary), `.off` (text), `.glb` (binary glTF 2.0) or `.gltf` (glTF 2.0). Errors begin with the
    /// name.
    ///
    /// Of every format only positions, faces and colours of vertices are read: normals, textures
    /// (see [`Mesh::load_textured`]), colours of faces, materials, lines and points are ignored, no other file is
    /// opened, and objects and groups are merged. Vertices keep their number and order, and degenerate faces stay. Polygons (OBJ, PLY, OFF)
    /// are cut into triangles by clipping ears, which keeps their winding and the area of concave
    /// ones. Numbers in text are read to 64 bits.
    ///
    /// STL files repeat each vertex for each triangle. Corners at equal coordinates, to the last
    /// bit and with -0 equal to 0, become one vertex, in the order of first use: so closed surfaces
    /// are closed.
    ///
    /// Of a GLB or glTF file all triangles, strips and fans of the default scene are read (of the first
    /// scene if none is the default, of all nodes if there is no scene), moved as their nodes say;
    /// where a node mirrors, the winding is turned. Each node brings a copy of its mesh's vertices.
    /// Skins, morph targets and animations are ignored: the mesh is as it is modelled.
    ///
    /// The buffers of such a file lie in its binary chunk, in data URIs or, for [`Mesh::load`], in other files. Since a small file can place a mesh many times, it may have
    /// up to 20 million vertices and 20 million faces in the end, half as many with colours and with a texture; longer files as many as their
    /// length holds.
    ///
    /// Colours are read as pictures and screens have them, from 0 to 1 (sRGB):
    ///
    /// - OBJ: `v x y z r g b`, from 0 to 1. A file where only some vertices have six numbers has no
    ///   colours.
    /// - PLY: the properties `red`, `green` and `blue` of the vertices, all three: whole numbers up to
    ///   255 (to 65535 as `ushort`), or floats from 0 to 1.
    /// - OFF: the numbers behind the position, and the normal of a `CNOFF` file, of a vertex in a `COFF` file, from 0 to 1 or to 255.
    /// - GLB and glTF: `COLOR_0` times the factor of the material (`baseColorFactor`, or `diffuseFactor` of
    ///   `KHR_materials_pbrSpecularGlossiness`), unless it shows a picture or parts with other factors use the same vertices. These numbers are linear, so they are converted; transparency is ignored. Where only some parts
    ///   have colours, the others are white, which is what leaving them out means there.
    ///
    /// Files have other colours too, and a mesh is worth having without. Roundings, less than 0.004 beyond 0 and 1, are clamped. Numbers from
    /// 0 to 255 where 1 should be full are scaled if all are whole, or one is above 16. Whatever else is not from 0 to 1 leaves
    /// all colours out, except that finite ones of a GLB file are clamped, as the format asks. [`Mesh::load_textured`] warns of it.
    ///
    /// # Errors
    ///
    /// If the name has another ending, if there are no faces, or at the first part of the file
    /// that is not as its format says, such as a coordinate which is missing, not a number or not
    /// finite in 32 bits, an index which is out of range, a face with fewer
    /// than three corners, or an end that comes too early. Compressed GLB files, those that need other files, and those that require an
    /// extension which may move, hide or copy triangles are refused; so are polygons that cross themselves so often that cutting them would
    /// take long.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Mesh, MeshError> {
        format_of(Path::new(name), name)?.parse(bytes, name, None, false).map(|(mesh, _)| mesh)
    }
}

impl Format {
    /// The mesh, with its texture if that is wanted, and warnings. `folder`: of the file, for other files there.
    fn parse(
        self,
        bytes: &[u8],
        name: &str,
        folder: Option<&Path>,
        textured: bool,
    ) -> Result<(Mesh, Vec<MeshError>), MeshError> {
        let parsed = match self {
            Self::Obj => obj::parse(bytes, folder.filter(|_| textured)),
            Self::Ply => ply::parse(bytes),
            Self::Stl => stl::parse(bytes),
            Self::Glb => glb::parse(bytes, folder, textured),
            Self::Gltf => glb::parse_text(bytes, folder, textured),
            Self::Off => off::parse(bytes),
        };
        let Parts { positions, faces, colours, texture, warnings } =
            parsed.map_err(|trouble| trouble.of_file(name))?;
        let mut mesh = Mesh::new(positions, faces)?;
        if let Some(colours) = colours {
            mesh = mesh.with_colours(colours)?;
        }
        if let Some(texture) = texture {
            mesh = mesh.with_texture(texture)?;
        }
        Ok((mesh, warnings.into_iter().map(|trouble| trouble.of_file(name)).collect()))
    }
}

/// The content of the file at `path`, its name and its format.
fn opened(path: &Path) -> Result<(Vec<u8>, String, Format), MeshError> {
    let name = path.display().to_string();
    open_regular(path).map_err(|reason| MeshError::Read { path: path.into(), reason })?;
    // The ending comes before the bytes: a film may be large.
    let format = format_of(path, &name)?;
    Ok((beside::read(path)?, name, format))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

fn format_of(path: &Path, name: &str) -> Result<Format, MeshError> {
    Format::of(path).ok_or_else(|| MeshError::UnknownFormat { name: name.to_owned() })
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
