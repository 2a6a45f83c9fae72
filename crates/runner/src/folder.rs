use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use crate::{Command, Error};

pub(crate) const RESULT: &str = "result.json";
pub(crate) const CURVE: &str = "curve.csv";
pub(crate) const BEFORE_AFTER: &str = "before_after.png";
pub(crate) const ANIMATION: &str = "animation.gif";
pub(crate) const REPORT: &str = "report.html";
pub(crate) const CONVERGENCE: &str = "convergence.csv";
pub(crate) const AGAINST_CURVE: &str = "against_curve.csv";
pub(crate) const CHOICE: &str = "choose.json";
pub(crate) const SEARCH: &str = "search.json";
pub(crate) const CELLS: &str = "search.csv";

pub(crate) const LEARN: &str = "learn.json";

/// Files that tell of the last runs. Those of a search stay until the next one.
const OF_RUNS: [&str; 7] =
    [CURVE, CONVERGENCE, AGAINST_CURVE, BEFORE_AFTER, ANIMATION, REPORT, RESULT];
const OF_SEARCH: [&str; 2] = [CELLS, SEARCH];

/// The folder for the results, in which files appear whole or not at all.
///
/// Files are first written under hidden names, and get their own in [`commit`](Folder::commit).
/// Without it nothing stays behind, not even the folder if it was made for this.
pub(crate) struct Folder {
    path: PathBuf,
    made: Vec<PathBuf>,
    staged: Vec<(&'static str, NamedTempFile)>,
}

impl Folder {
    /// Makes the folder if it is missing, and makes sure that files can be written to it.
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let missing = path.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists());
        let made = missing.map(Path::to_path_buf).collect();
        let folder = Folder { path: path.into(), made, staged: Vec::new() };
        let tried =
            fs::create_dir_all(path).and_then(|()| folder.temporary()).and_then(|_| match OF_RUNS
                .iter()
                .chain(&OF_SEARCH)
                .find(|name| path.join(name).is_dir())
            {
                Some(name) => Err(io::Error::other(format!("{name} in it is a folder"))),
                None => Ok(()),
            });
        match tried {
            Ok(()) => Ok(folder),
            Err(reason) => Err(folder.refused(reason)),
        }
    }

    /// Where the journal of a command stands.
    pub(crate) fn journal(&self, command: Command) -> PathBuf {
        self.path.join(format!("{}.jsonl", command.name()))
    }

    /// Where learning stands.
    pub(crate) fn checkpoint(&self) -> PathBuf {
        self.path.join("learn.checkpoint.json")
    }

    /// Writes a file under a hidden name.
    pub(crate) fn stage(&mut self, name: &'static str, bytes: &[u8]) -> Result<(), Error> {
        let written = self.temporary().and_then(|mut file| file.write_all(bytes).map(|()| file));
        let file = written.map_err(|reason| self.refused(reason))?;
        self.staged.push((name, file));
        Ok(())
    }

    /// Gives all files their names; removes those of an earlier run that this one does not have.
    pub(crate) fn commit(mut self) -> Result<(), Error> {
        let staged = std::mem::take(&mut self.staged);
        let missing = |name: &&str| staged.iter().all(|(staged, _)| staged != name);
        let stale = OF_RUNS.into_iter().filter(missing);
        for name in stale.collect::<Vec<_>>() {
            match fs::remove_file(self.path.join(name)) {
                Err(reason) if reason.kind() != io::ErrorKind::NotFound => {
                    return Err(self.refused(reason));
                }
                _ => {}
            }
        }
        for (name, file) in staged {
            file.persist(self.path.join(name)).map_err(|failed| self.refused(failed.error))?;
        }
        self.made.clear();
        Ok(())
    }

    fn temporary(&self) -> io::Result<NamedTempFile> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".softrast-").suffix(".tmp");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // Temporary files are private by default; results are as readable as any new file.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        builder.tempfile_in(&self.path)
    }

    fn refused(&self, reason: io::Error) -> Error {
        Error::Folder { path: self.path.clone(), reason }
    }
}

impl Drop for Folder {
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
        let mut folder = Folder::open(&out).unwrap();
        folder.stage(ANIMATION, b"gif").unwrap();
        folder.stage(RESULT, b"old").unwrap();
        assert!(!out.join(RESULT).exists());
        folder.commit().unwrap();
        assert_eq!(names(&out), [ANIMATION, RESULT]);

        fs::write(out.join("notes.txt"), "mine").unwrap();
        let mut folder = Folder::open(&out).unwrap();
        folder.stage(RESULT, b"new").unwrap();
        folder.commit().unwrap();
        assert_eq!(names(&out), ["notes.txt", RESULT]);
        assert_eq!(fs::read(out.join(RESULT)).unwrap(), b"new");
    }

    #[test]
    fn nothing_stays_behind_without_a_commit() {
        let root = tempfile::tempdir().unwrap();
        let mut folder = Folder::open(&root.path().join("a/b")).unwrap();
        folder.stage(RESULT, b"half").unwrap();
        drop(folder);
        assert!(names(root.path()).is_empty());
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_refused_and_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("file"), "").unwrap();
        assert!(Folder::open(&root.path().join("file/out")).is_err());
        assert!(Folder::open(&root.path().join("file")).is_err());
        fs::create_dir_all(root.path().join("out").join(RESULT)).unwrap();
        assert!(Folder::open(&root.path().join("out")).is_err());
        assert_eq!(names(root.path()), ["file", "out"]);
    }

    #[cfg(unix)]
    #[test]
    fn results_are_readable_as_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let root = tempfile::tempdir().unwrap();
        let mut folder = Folder::open(root.path()).unwrap();
        folder.stage(RESULT, b"{}").unwrap();
        folder.commit().unwrap();
        fs::write(root.path().join("plain"), "").unwrap();
        let mode = |name| root.path().join(name).metadata().unwrap().permissions().mode();
        assert_eq!(mode(RESULT), mode("plain"));
    }
}
