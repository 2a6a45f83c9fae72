//! Writing of meshes, in the format of the path's extension.

use std::{
    fs,
    io::{self, Write},
    path::Path,
};

use crate::{Mesh, MeshError, format::Format, glb_writer, obj::Obj, ply};

impl Mesh {
    /// The text of an OBJ file, with as many digits as the numbers need; colours as `v x y z r g b`. The coordinates of a texture are
    /// written, but not its picture: GLB holds both.
    pub fn to_obj(&self) -> String {
        Obj(self).to_string()
    }

    /// The bytes of a PLY file: binary, little endian, with coordinates in 64 bits, so they are exact.
    ///
    /// Colours are rounded to 8 bits, `uchar red`, `green` and `blue`, which all programs read. A texture is omitted.
    pub fn to_ply(&self) -> Vec<u8> {
        ply::bytes(self)
    }

    /// The bytes of a GLB file (binary glTF 2.0) with one mesh and a two-sided material, grey unless the mesh has colours.
    ///
    /// Coordinates are rounded to 32 bits, the only type of the format. A mesh that is far from the origin for its size is therefore
    /// written relative to [`Mesh::glb_origin`], to which its node moves it. Colours are written as linear ones, as the format requires, in
    /// 32 bits. A texture is written with its pictures, unchanged; colours are then omitted, since programs would show the product of both,
    /// unless that is intended ([`Texture::multiplies_colours`](crate::Texture::multiplies_colours)), and faces are sorted by material. The
    /// format has one texture coordinate per vertex, so vertices on seams are duplicated, and unused ones are removed.
    ///
    /// # Panics
    ///
    /// If the file would have 4 GiB or more, which the format cannot represent.
    pub fn to_glb(&self) -> Vec<u8> {
        glb_writer::bytes(self)
    }

    /// The translation of the node in [`Mesh::to_glb`], in world units: approximately the middle of the mesh if 32 bits would round
    /// coordinates by more than 1e-5 of its longest side, as on a map, else zeros.
    ///
    /// ```
    /// use softrast_mesh::{Mesh, icosphere};
    ///
    /// let ball = icosphere(1);
    /// let on_map = ball.positions().iter().map(|&[x, y, z]| [x + 4e5, y + 5e6, z]).collect();
    /// let on_map = ball.with_positions(on_map)?;
    /// assert_eq!((ball.glb_origin(), on_map.glb_origin()), ([0.0; 3], [4e5, 5e6, 0.0]));
    /// let back = Mesh::parse(&on_map.to_glb(), "map.glb")?;
    /// assert!((back.bounds()[1][0] - on_map.bounds()[1][0]).abs() < 1e-6);
    /// # Ok::<(), softrast_mesh::MeshError>(())
    /// ```
    pub fn glb_origin(&self) -> [f64; 3] {
        glb_writer::origin(self)
    }

    /// The function for the bytes of a file with the extension of `path`: OBJ, PLY or GLB, in any case.
    ///
    /// # Errors
    ///
    /// If the path has another extension.
    pub fn writer(path: &Path) -> Result<fn(&Self) -> Vec<u8>, MeshError> {
        match Format::of(path) {
            Some(Format::Obj) => Ok(|mesh| mesh.to_obj().into_bytes()),
            Some(Format::Ply) => Ok(Self::to_ply),
            Some(Format::Glb) => Ok(Self::to_glb),
            Some(Format::Stl | Format::Off | Format::Gltf) | None => {
                Err(MeshError::NotWritten { path: path.into() })
            }
        }
    }

    /// Writes the mesh to a file at `path`: OBJ, PLY or GLB by its extension, in any case.
    ///
    /// [`Mesh::load`] reads OBJ back unchanged, PLY with colours rounded to 8 bits, GLB with all numbers rounded to 32 bits;
    /// [`Mesh::load_textured`] also the texture, as far as it was written. The file is written atomically: under another name in the same
    /// folder, then renamed.
    ///
    /// # Errors
    ///
    /// If the path has another extension, the folder is missing, or the file cannot be written.
    ///
    /// # Panics
    ///
    /// If a GLB file would have 4 GiB or more.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), MeshError> {
        let path = path.as_ref();
        let bytes = Self::writer(path)?(self);
        write(path, &bytes).map_err(|reason| MeshError::Write { path: path.into(), reason })
    }
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    #[cfg_attr(not(unix), allow(unused_mut, reason = "permissions are for unix"))]
    let mut builder = tempfile::Builder::new();
    // A temporary file is private by default; this one becomes an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(fs::canonicalize(folder.unwrap_or(Path::new(".")))?)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_mesh_reads_back_the_same() {
        let positions =
            vec![[0.1, -1e-42, 3e38], [1.0 / 3.0, -0.0, 1e30], [5e-324, 2.0, 16777216.5]];
        let mesh = Mesh::new(positions, vec![[2, 0, 1], [1, 1, 1]]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.obj", "a.PLY"] {
            let path = folder.path().join(name);
            for _overwrite in 0..2 {
                mesh.save(&path).unwrap();
                assert_eq!(Mesh::load(&path).unwrap(), mesh);
            }
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_glb_keeps_the_shape_of_a_mesh_far_from_the_origin() {
        let ball = crate::icosphere(2);
        assert_eq!(ball.glb_origin(), [0.0; 3]);
        let place = |p: &[f64; 3]| [4.123e5 + 0.1 * p[0], 5e6 + 0.1 * p[1], 0.1 * p[2]];
        let map = ball.with_positions(ball.positions().iter().map(place).collect()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        map.save(&path).unwrap();
        let back = Mesh::load(&path).unwrap();
        let pairs = back.positions().iter().flatten().zip(map.positions().iter().flatten());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-8));
        assert_eq!(map.glb_origin()[1], 5e6);
    }

    #[test]
    fn missing_folder_is_named() {
        let mesh = Mesh::new(vec![[0.0; 3]], vec![[0, 0, 0]]).unwrap();
        let message = mesh.save("no/such/folder.obj").unwrap_err().to_string();
        assert!(message.starts_with("no/such/folder.obj: cannot be written: "), "{message}");
    }
}
