use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use crate::Error;

/// Writes a file; whenever the program dies, the file is the old one or the new one, whole.
///
/// # Errors
///
/// What the system says.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = temporary(folder.unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    // The name must not reach the disk before the bytes do.
    file.as_file().sync_all()?;
    file.persist(path).map(drop).map_err(|failed| failed.error)
}

fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".softrast-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private by default; results are as readable as any new file.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// The folder for the results, in which files appear together, each whole or not at all.
///
/// Files are first written under hidden names, and get their own in [`commit`](OutputFolder::commit). Without it nothing stays
/// behind, not even the folder if it was made for this.
pub struct OutputFolder {
    path: PathBuf,
    made: Vec<PathBuf>,
    staged: Vec<(String, NamedTempFile)>,
}

impl OutputFolder {
    /// Makes the folder if it is missing, and makes sure that files can be written to it.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if they cannot.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let missing = path.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists());
        let made = missing.map(Path::to_path_buf).collect();
        let folder = Self { path: path.into(), made, staged: Vec::new() };
        match fs::create_dir_all(path).and_then(|()| temporary(path)) {
            Ok(_) => Ok(folder),
            Err(reason) => Err(folder.refused(reason)),
        }
    }

    /// Where a file of this name stands.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file under a hidden name.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if it cannot be written, or a folder has its name.
    pub fn stage(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        if self.file(name).is_dir() {
            return Err(self.refused(io::Error::other(format!("{name} in it is a folder"))));
        }
        let written =
            temporary(&self.path).and_then(|mut file| file.write_all(bytes).map(|()| file));
        let file = written.map_err(|reason| self.refused(reason))?;
        self.staged.push((name.to_owned(), file));
        Ok(())
    }

    /// Gives all files their names; removes those of `replaced` that an earlier command left and this one does not have. One that ends in
    /// `*` stands for all that begin like it.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if a file cannot be renamed or removed.
    pub fn commit(mut self, replaced: &[&str]) -> Result<(), Error> {
        let staged = std::mem::take(&mut self.staged);
        let is_replaced = |name: &str| {
            let matches =
                |of: &str| of.strip_suffix('*').map_or(name == of, |of| name.starts_with(of));
            replaced.iter().any(|of| matches(of)) && staged.iter().all(|(staged, _)| staged != name)
        };
        for entry in fs::read_dir(&self.path).map_err(|reason| self.refused(reason))? {
            let path = entry.map_err(|reason| self.refused(reason))?.path();
            if path.file_name().and_then(|name| name.to_str()).is_some_and(is_replaced) {
                fs::remove_file(&path).map_err(|reason| self.refused(reason))?;
            }
        }
        for (name, file) in staged {
            file.persist(self.path.join(name)).map_err(|failed| self.refused(failed.error))?;
        }
        self.made.clear();
        Ok(())
    }

    fn refused(&self, reason: io::Error) -> Error {
        Error::Folder { path: self.path.clone(), reason }
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        self.staged.clear();
        for folder in &self.made {
            // Fails where somebody else has put a file there meanwhile, which is right.
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(path: &Path) -> Vec<String> {
        let entries = fs::read_dir(path).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn files_appear_together_and_replace_those_of_an_earlier_run() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("a/b");
        let mut folder = OutputFolder::open(&out).unwrap();
        folder.stage("a.gif", b"gif").unwrap();
        folder.stage("r.json", b"old").unwrap();
        assert!(!out.join("r.json").exists());
        folder.commit(&[]).unwrap();
        assert_eq!(names(&out), ["a.gif", "r.json"]);

        fs::write(out.join("notes.txt"), "mine").unwrap();
        let mut folder = OutputFolder::open(&out).unwrap();
        folder.stage("r.json", b"new").unwrap();
        folder.commit(&["a.gif", "b.gif", "r.json"]).unwrap();
        assert_eq!(names(&out), ["notes.txt", "r.json"]);
        assert_eq!(fs::read(out.join("r.json")).unwrap(), b"new");
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_refused_and_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("file"), "").unwrap();
        assert!(OutputFolder::open(&root.path().join("file/out")).is_err());
        assert!(OutputFolder::open(&root.path().join("file")).is_err());
        fs::create_dir_all(root.path().join("out/r.json")).unwrap();
        let mut folder = OutputFolder::open(&root.path().join("out")).unwrap();
        assert!(folder.stage("r.json", b"").unwrap_err().to_string().contains("is a folder"));
        drop(folder);
        assert_eq!(names(root.path()), ["file", "out"]);
    }

    #[cfg(unix)]
    #[test]
    fn files_are_whole_and_as_readable_as_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("r.json");
        write_atomically(&path, b"old").unwrap();
        write_atomically(&path, b"{}").unwrap();
        assert_eq!((fs::read(&path).unwrap(), names(root.path()).len()), (b"{}".to_vec(), 1));
        fs::write(root.path().join("plain"), "").unwrap();
        let mode = |name| root.path().join(name).metadata().unwrap().permissions().mode();
        assert_eq!(mode("r.json"), mode("plain"));
    }
}
