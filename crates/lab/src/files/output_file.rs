use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{atomic::write_atomically, output_folder::OutputFolder};
use crate::{Error, Inputs};

/// A result file named by a flag; its folder is created if missing.
pub struct OutputFile {
    path: PathBuf,
    folder: OutputFolder,
}

impl OutputFile {
    /// Checks that it can be written: it does not exist, is empty, or is of the same `kind` and not
    /// an input of the run. `is_kind` tests whether the file at a path is of the kind.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if it cannot be written; [`Error::Taken`] if it is an input or of another kind.
    pub fn open(
        path: &Path,
        kind: &str,
        is_kind: impl Fn(&Path) -> bool,
        inputs: &Inputs,
    ) -> Result<Self, Error> {
        let why = match fs::metadata(path) {
            Err(_) => None,
            Ok(found) if found.is_dir() => Some("is a folder, not a file".to_owned()),
            Ok(_) if inputs.holds(path) => {
                Some("is an input of this run, which would replace it".to_owned())
            }
            Ok(found) if !found.is_file() => Some("is not a regular file".to_owned()),
            Ok(found) if found.len() > 0 && !is_kind(path) => {
                Some(format!("exists and is not a {kind}, so it is not replaced"))
            }
            Ok(_) => None,
        };
        if let Some(why) = why {
            return Err(Error::Taken {
                path: path.into(),
                why: format!("{why}: name another file"),
            });
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = OutputFolder::writable(folder.unwrap_or(Path::new(".")), "", inputs)?;
        Ok(Self { path: path.into(), folder })
    }

    /// Writes it, completely or not at all.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if it cannot be written.
    pub fn write(mut self, bytes: &[u8]) -> Result<(), Error> {
        let written = write_atomically(&self.path, bytes);
        written.map_err(|reason| self.folder.refused(reason))?;
        self.folder.made.clear();
        Ok(())
    }
}
