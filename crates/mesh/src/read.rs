//! Reading of meshes, in the format of the file's extension.

use std::path::Path;

use crate::{
    Mesh, MeshError, bounded::open_regular, format::Format, glb, obj, off, parts::Parts, ply,
    referenced, stl,
};

impl Mesh {
    /// The mesh in the file at `path`: OBJ, PLY, STL, OFF, GLB or glTF by its extension; see [`Mesh::parse`]. Buffers of a GLB or glTF file
    /// may be in other files in its folder or below it.
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
    /// Errors in colours, textures, pictures and materials do not prevent reading the mesh. Each warning is one line about something in the
    /// file that is missing or changed in the mesh: colours that are omitted, scaled or clamped (see [`Mesh::parse`]), a texture or its
    /// picture that is omitted, a material library that cannot be read, a required glTF extension that is unsupported. `Mesh::load` returns
    /// the same mesh except the texture, without warnings.
    ///
    /// A texture covers all faces of a mesh, and each face has the picture or the colour of its [`Material`](crate::Material). A texture is
    /// omitted if corners that need a coordinate have none; if a picture cannot be read, coordinates are kept. Other properties of
    /// materials are ignored; beyond 0 to 1 pictures always repeat.
    ///
    /// - OBJ: `vt` at the corners of faces, and `map_Kd` of the materials of `mtllib`; without it `Kd` in sRGB, unless vertices have
    ///   colours. Options of `map_Kd` are unsupported. A line `mtllib` names one library, or several that end in `.mtl`; names may contain
    ///   spaces.
    /// - GLB and glTF: `TEXCOORD_0` or `TEXCOORD_1`, as selected by the base colour texture, or by the diffuse texture of
    ///   `KHR_materials_pbrSpecularGlossiness`; v is flipped so that it is up. The picture is in the file, in a data URI, or in a separate
    ///   file. Factors and vertex colours multiply it, as in the format.
    ///
    /// A mesh has up to 1000 pictures, of 1 GiB in total. Pictures are PNG or JPEG. Material libraries must be in the folder of the mesh or
    /// below it, pictures in the folder of the mesh (GLB, glTF) or of the library (OBJ) or below it; no other file is opened: only the last
    /// component of a path that leads out of the folder is used. Links in the folder are followed.
    ///
    /// # Errors
    ///
    /// The errors of [`Mesh::load`].
    pub fn load_textured(path: impl AsRef<Path>) -> Result<(Mesh, Vec<MeshError>), MeshError> {
        let path = path.as_ref();
        let (bytes, name, format) = opened(path)?;
        format.parse(&bytes, &name, Some(folder_of(path)), true)
    }

    /// The mesh in `bytes`, the content of a file called `name`.
    ///
    /// The extension of the name, in any case, determines the format: `.obj`, `.ply` (text, or binary in either byte order), `.stl` (text
    /// or binary), `.off` (text), `.glb` (binary glTF 2.0) or `.gltf` (glTF 2.0). Errors start with the name.
    ///
    /// Only positions, faces and vertex colours are read: normals, textures (see [`Mesh::load_textured`]), face colours, materials, lines
    /// and points are ignored, no other file is opened, and objects and groups are merged. Vertices keep their number and order, and
    /// degenerate faces are kept. Polygons (OBJ, PLY, OFF) are triangulated by ear clipping, which keeps their winding and the area of
    /// concave ones. Numbers in text are read to 64 bits.
    ///
    /// STL files repeat each vertex for each triangle. Corners at equal coordinates, bit by bit and with -0 equal to 0, become one vertex,
    /// in the order of first use, so that closed surfaces are closed.
    ///
    /// From a GLB or glTF file all triangles, strips and fans of the default scene are read (of the first scene if none is the default, of
    /// all nodes if there is no scene), transformed by their nodes; reflections reverse the winding. Each node adds a copy of its mesh's
    /// vertices. Skins, morph targets and animations are ignored: the mesh is in its modelled pose.
    ///
    /// The buffers of such a file are in its binary chunk, in data URIs or, for [`Mesh::load`], in other files. Since a small file can
    /// place a mesh many times, at most 20 million vertices and 20 million faces are allowed, half as many with colours and with a texture;
    /// for longer files, as many as their length can hold.
    ///
    /// Colours are read in sRGB, from 0 to 1:
    ///
    /// - OBJ: `v x y z r g b`, from 0 to 1. A file where only some vertices have six numbers has no colours.
    /// - PLY: the properties `red`, `green` and `blue` of the vertices, all three: integers up to 255 (to 65535 as `ushort`), or floats
    ///   from 0 to 1.
    /// - OFF: the numbers of a vertex in a `COFF` file after its position, in a `CNOFF` file after its normal, from 0 to 1 or to 255.
    /// - GLB and glTF: `COLOR_0` times the factor of the material (`baseColorFactor`, or `diffuseFactor` of
    ///   `KHR_materials_pbrSpecularGlossiness`), unless it has a picture or parts with other factors use the same vertices. These numbers
    ///   are linear and are converted to sRGB; alpha is ignored. If only some parts have colours, the others are white, the default of the
    ///   format.
    ///
    /// Other colours do not prevent reading the mesh. Rounding errors, less than 0.004 beyond 0 and 1, are clamped. Numbers from 0 to 255
    /// in place of 0 to 1 are scaled if all are integers, or one is above 16. If others are not from 0 to 1, all colours are omitted,
    /// except that finite ones of a GLB file are clamped, as the format requires. [`Mesh::load_textured`] warns about this.
    ///
    /// # Errors
    ///
    /// If the name has another extension, if there are no faces, or at the first violation of the format, such as a coordinate which is
    /// missing, not a number or not finite in 32 bits, an index which is out of range, a face with fewer than three corners, or a premature
    /// end. Compressed GLB files, those that need other files, and those that require an extension which may move, hide or copy triangles
    /// are refused; so are polygons that cross themselves so often that triangulation would take long.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Mesh, MeshError> {
        format_of(Path::new(name), name)?.parse(bytes, name, None, false).map(|(mesh, _)| mesh)
    }
}

impl Format {
    /// The mesh, with its texture if it is wanted, and warnings. `folder` is that of the file, for other files there.
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
    // The extension is checked before the file is read: it may be a large video.
    let format = format_of(path, &name)?;
    Ok((referenced::read(path)?, name, format))
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
