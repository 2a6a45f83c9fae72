use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use super::{
    atomic::{hidden, write_atomically},
    before::Before,
};
use crate::{
    Error, Inputs,
    manifest::{MANIFEST, Manifest, Owner, What, begins, content, content_of, is_name},
};

/// The folder for the results of a command, in which files appear together, each complete or not at all.
///
/// Files are first written under hidden names, and renamed in [`commit`](OutputFolder::commit), which also removes results of an earlier
/// run of the command that this one does not have. Without `commit` nothing remains, not even the folder if it was newly created.
pub struct OutputFolder {
    path: PathBuf,
    /// Program and command.
    command: String,
    inputs: Inputs,
    pub(super) made: Vec<PathBuf>,
    /// Whether the list of results was created for this run.
    lists: bool,
    pub(super) staged: Vec<(String, NamedTempFile)>,
}

impl OutputFolder {
    /// Creates the folder if it is missing, and checks that files can be written to it. `command`
    /// owns the results that are replaced, such as `pose evaluate`.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if files cannot be written.
    pub fn open(path: &Path, command: &str, inputs: &Inputs) -> Result<Self, Error> {
        let folder = Self::writable(path, command, inputs)?;
        folder.list()?;
        Ok(folder)
    }

    /// The folder, without a list yet.
    pub(super) fn writable(path: &Path, command: &str, inputs: &Inputs) -> Result<Self, Error> {
        let missing = path.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists());
        let made = missing.map(Path::to_path_buf).collect();
        let (command, inputs) = (command.to_owned(), inputs.clone());
        let folder =
            Self { path: path.into(), command, inputs, made, lists: false, staged: Vec::new() };
        match fs::create_dir_all(path).and_then(|()| hidden().tempfile_in(path)) {
            Ok(_) => Ok(folder),
            Err(reason) => Err(folder.refused(reason)),
        }
    }

    /// The path of the file of this name.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Checks that files of these names may be written: before the work, so that a refusal comes early.
    ///
    /// # Errors
    ///
    /// [`Error::Taken`] if one is an input of the run, a result of another command, or the user's own.
    pub fn claim<N: AsRef<str>>(&self, names: impl IntoIterator<Item = N>) -> Result<(), Error> {
        let list = self.list()?;
        names.into_iter().try_for_each(|name| self.check(name.as_ref(), &list).map(drop))
    }

    /// Writes a file under a hidden name.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if it cannot be written, [`Error::Taken`] as [`claim`](OutputFolder::claim).
    pub fn stage(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.claim([name])?;
        if !is_name(name) || self.staged.iter().any(|(staged, _)| staged == name) {
            let reason = io::Error::other(format!("two files cannot both be {name}"));
            return Err(self.refused(reason));
        }
        let written = hidden().tempfile_in(&self.path);
        let written = written.and_then(|mut file| file.write_all(bytes).map(|()| file));
        let file = written.map_err(|reason| self.refused(reason))?;
        self.staged.push((name.to_owned(), file));
        Ok(())
    }

    /// Renames all files to their names, and removes the results of earlier runs of the command that this one does not have.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if a file cannot be renamed or removed, [`Error::Taken`] as
    /// [`claim`](OutputFolder::claim). All earlier results are then in place.
    pub fn commit(&mut self) -> Result<(), Error> {
        self.commit_beside(|_| false)
    }

    /// [`commit`](OutputFolder::commit), except that earlier results whose names satisfy `stays` are not removed.
    ///
    /// # Errors
    ///
    /// As [`commit`](OutputFolder::commit).
    pub fn commit_beside(&mut self, stays: impl Fn(&str) -> bool) -> Result<(), Error> {
        let staged = std::mem::take(&mut self.staged);
        let mut list = self.list()?;
        let mut settled = list.clone();
        for (name, file) in &staged {
            let before = self.check(name, &list)?.then(|| content(&self.file(name)));
            let before = before.transpose().map_err(|reason| self.refused(reason))?;
            let new = content(file.path()).map_err(|reason| self.refused(reason))?;
            settled.insert(name, &self.command, What::Result(vec![new.clone()]));
            let contents = before.into_iter().chain([new]).collect();
            list.insert(name, &self.command, What::Result(contents));
        }
        let mut stale = Vec::new();
        for name in list.results(&self.command) {
            if staged.iter().all(|(staged, _)| staged != name) && !stays(name) {
                // A file that the user has changed is no longer a result; an input of this run still is.
                match self.check(name, &list) {
                    Ok(true) => stale.push(name.to_owned()),
                    Err(_) if self.inputs.holds(&self.file(name)) => {}
                    _ => settled.remove(name),
                }
            }
        }
        self.write_list(&list)?;
        if let Err(reason) = self.replace(staged, &stale) {
            return Err(self.refused(reason));
        }
        stale.iter().for_each(|name| settled.remove(name));
        self.made.clear();
        // The old list names the same files, so nothing is lost if it remains.
        let _ = self.write_list(&settled);
        Ok(())
    }

    /// Renames and removes; if that fails midway, everything is undone.
    pub(super) fn replace(
        &self,
        staged: Vec<(String, NamedTempFile)>,
        stale: &[String],
    ) -> io::Result<()> {
        let mut before = Vec::new();
        let all = || {
            for (name, file) in staged {
                let path = self.file(&name);
                before.push(Before::of(&path)?);
                file.persist(path).map_err(|failed| failed.error)?;
            }
            for name in stale {
                let path = self.file(name);
                before.push(Before::of(&path)?);
                fs::remove_file(path)?;
            }
            Ok(())
        };
        let done = all();
        if done.is_err() {
            before.into_iter().rev().for_each(Before::restore);
        }
        done
    }

    /// Writes a file at once, for a later call to continue from. It remains when results are replaced.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if it cannot be written, [`Error::Taken`] as [`claim`](OutputFolder::claim).
    pub fn keep(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let mut list = self.list()?;
        let path = self.file(name);
        let before = self.check(name, &list)?.then(|| content(&path)).transpose();
        let before = before.map_err(|reason| self.refused(reason))?;
        let contents = before.into_iter().chain([content_of(bytes)]).collect();
        list.insert(name, &self.command, What::Kept(contents));
        self.write_list(&list)?;
        write_atomically(&path, bytes).map_err(|reason| self.refused(reason))
    }

    /// Lists a file that a later call continues from: the caller has read and verified it.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if the file cannot be read or the list cannot be written, [`Error::Taken`] if it is an input or no regular file.
    pub fn adopt(&mut self, name: &str) -> Result<(), Error> {
        let mut list = self.list()?;
        let found = content(&self.file(name)).map_err(|reason| self.refused(reason))?;
        list.insert(name, &self.command, What::Kept(vec![found]));
        self.check(name, &list)?;
        self.write_list(&list)
    }

    /// The path of a file that grows while the command works and always begins with `begins`, such as the records of finished runs.
    ///
    /// A command that `resumes` continues an existing file, and renames its own file with another beginning to `NAME.damaged`.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if files cannot be read or written, [`Error::Taken`] as [`claim`](OutputFolder::claim).
    pub fn journal(&mut self, name: &str, begins: &str, resumes: bool) -> Result<PathBuf, Error> {
        let mut list = self.list()?;
        let path = self.file(name);
        let is_listed = list.names().any(|listed| listed == name);
        let mut with_it = list.clone();
        with_it.insert(name, &self.command, What::Journal(begins.to_owned()));
        let found = match is_listed || !resumes {
            true => self.check(name, &list),
            false => self.check(name, &with_it),
        };
        match found {
            Err(Error::Taken { .. })
                if resumes && is_listed && self.is_damaged(name, &list, begins) =>
            {
                self.set_aside(&path).map_err(|reason| self.refused(reason))?;
            }
            found => drop(found?),
        }
        list.insert(name, &self.command, What::Journal(begins.to_owned()));
        self.write_list(&list)?;
        Ok(path)
    }

    /// Whether a file is a journal of this command whose beginning has changed.
    fn is_damaged(&self, name: &str, list: &Manifest, head: &str) -> bool {
        let path = self.file(name);
        let is_file = fs::symlink_metadata(&path).is_ok_and(|found| found.is_file());
        is_file
            && !self.inputs.holds(&path)
            && begins(&path, head).is_ok_and(|begins| !begins)
            && matches!(list.owner(name, &path, &self.command), Ok(Owner::Changed))
    }

    fn set_aside(&self, path: &Path) -> io::Result<()> {
        for k in 1.. {
            let mut aside = path.as_os_str().to_owned();
            aside.push(if k == 1 { ".damaged".to_owned() } else { format!(".damaged.{k}") });
            if fs::symlink_metadata(&aside).is_err() {
                return fs::rename(path, aside);
            }
        }
        unreachable!("there is a number that is not taken")
    }

    /// Whether a file of this name exists that may be replaced.
    fn check(&self, name: &str, list: &Manifest) -> Result<bool, Error> {
        let path = self.file(name);
        let found = match fs::symlink_metadata(&path) {
            Ok(found) => found,
            Err(missing) if missing.kind() == io::ErrorKind::NotFound => return Ok(false),
            Err(reason) => return Err(self.refused(reason)),
        };
        let why = if found.is_dir() {
            "is a folder, but a result has this name: choose another folder with --out".to_owned()
        } else if self.inputs.holds(&path) {
            "is an input of this run, which would replace it: choose another folder with --out"
                .into()
        } else if !found.is_file() {
            "is not a regular file, but a result has this name: choose another folder with --out"
                .into()
        } else {
            let owner = list.owner(name, &path, &self.command);
            match owner.map_err(|reason| self.refused(reason))? {
                Owner::Own => return Ok(true),
                Owner::Other(command) => {
                    format!("is a result of `{command}`: choose another folder with --out")
                }
                Owner::Changed => format!(
                    "was changed after `{}` had written it: move it, or choose another folder with --out",
                    self.command
                ),
                Owner::User => format!(
                    "is not a recorded result of `{}`, which would replace it: move it, or choose another folder with --out",
                    self.command
                ),
            }
        };
        Err(Error::Taken { path, why })
    }

    fn list(&self) -> Result<Manifest, Error> {
        Manifest::of(&self.path).map_err(|reason| self.refused(reason))
    }

    fn write_list(&mut self, list: &Manifest) -> Result<(), Error> {
        if self.list()? == *list {
            return Ok(());
        }
        let path = self.file(MANIFEST);
        self.lists |= !path.exists();
        write_atomically(&path, &list.text()).map_err(|reason| self.refused(reason))
    }

    pub(super) fn refused(&self, reason: io::Error) -> Error {
        Error::Folder { path: self.path.clone(), reason }
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        self.staged.clear();
        let has_one = |list: Manifest| list.names().any(|name| self.file(name).exists());
        if self.lists && Manifest::of(&self.path).is_ok_and(|list| !has_one(list)) {
            let _ = fs::remove_file(self.file(MANIFEST));
        }
        for folder in &self.made {
            // Fails if another process has put a file there meanwhile, as it should.
            let _ = fs::remove_dir(folder);
        }
    }
}
