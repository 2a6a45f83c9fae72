use std::{
    fs, io,
    path::{Path, PathBuf},
};

use tempfile::TempPath;

use super::atomic::hidden;

/// The previous content of a path.
pub(super) struct Before {
    path: PathBuf,
    /// The file under another name; `None` if there was none.
    file: Option<TempPath>,
}

impl Before {
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        if fs::symlink_metadata(path).is_err() {
            return Ok(Self { path: path.into(), file: None });
        }
        let folder = path.parent().unwrap_or(Path::new("."));
        // Not all file systems support links.
        let second = |hidden: &Path| {
            fs::hard_link(path, hidden).or_else(|_| fs::copy(path, hidden).map(drop))
        };
        let file = hidden().make_in(folder, second)?.into_temp_path();
        Ok(Self { path: path.into(), file: Some(file) })
    }

    pub(super) fn restore(self) {
        // If this fails, there is nothing left to try.
        let _ = match self.file {
            Some(file) => {
                let hidden = file.to_path_buf();
                let restored = file.persist(self.path).map_err(|failed| failed.error);
                // Renaming does nothing if both names are links to one file.
                let _ = fs::remove_file(hidden);
                restored
            }
            None => fs::remove_file(self.path),
        };
    }
}
