//! Writing an OBJ file.

use std::{
    fmt, fs,
    io::{self, Write},
    path::Path,
};

use crate::{Mesh, MeshError};

impl Mesh {
    /// Writes the mesh to an OBJ file at `path`, which [`Mesh::load`] reads back without change.
    ///
    /// The file appears whole or not at all: it is written under another name in the same folder,
    /// then renamed. Numbers have as many digits as they need.
    ///
    /// # Errors
    ///
    /// If the folder is missing, or the file cannot be written.
    pub fn write_obj(&self, path: impl AsRef<Path>) -> Result<(), MeshError> {
        let path = path.as_ref();
        write(path, &Obj(self).to_string())
            .map_err(|reason| MeshError::Write { path: path.into(), reason })
    }
}

fn write(path: &Path, text: &str) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    #[cfg_attr(not(unix), allow(unused_mut, reason = "permissions are for unix"))]
    let mut builder = tempfile::Builder::new();
    // A temporary file is private by default; this one becomes an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(fs::canonicalize(folder.unwrap_or(Path::new(".")))?)?;
    file.write_all(text.as_bytes())?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

/// A mesh as the text of an OBJ file.
pub(crate) struct Obj<'a>(pub(crate) &'a Mesh);

impl fmt::Display for Obj<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for [x, y, z] in self.0.positions() {
            writeln!(f, "v {x} {y} {z}")?;
        }
        for [a, b, c] in self.0.faces().iter().map(|face| face.map(|v| u64::from(v) + 1)) {
            writeln!(f, "f {a} {b} {c}")?;
        }
        Ok(())
    }
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
        let path = folder.path().join("a.obj");
        for _overwrite in 0..2 {
            mesh.write_obj(&path).unwrap();
            assert_eq!(Mesh::load(&path).unwrap(), mesh);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn missing_folder_is_named() {
        let mesh = Mesh::new(vec![[0.0; 3]], vec![[0, 0, 0]]).unwrap();
        let message = mesh.write_obj("no/such/folder.obj").unwrap_err().to_string();
        assert!(message.starts_with("no/such/folder.obj: cannot be written: "), "{message}");
    }
}
