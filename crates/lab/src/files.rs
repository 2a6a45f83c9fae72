//! Files of results: they appear whole or not at all, and replace nothing that is not theirs.
//!
//! A run replaces and removes only files that an earlier run of the same command has listed as its own and that nobody has changed since
//! (`manifest.rs` says how); never a file that it reads ([`Inputs`]), never by a pattern. All else is refused in one line, by
//! [`OutputFolder::claim`] before the work and again where files are written. A file that a flag names, as `render --out FILE` does, is
//! the user's choice: an [`OutputFile`] replaces one of its own kind, but no other and no input.

use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::{NamedTempFile, TempPath};

use crate::{
    Error, Inputs,
    manifest::{MANIFEST, Manifest, Owner, begins, content, content_of, is_name},
};

/// Writes a file; whenever the program dies, the file is the old one or the new one, whole.
///
/// # Errors
///
/// What the system says.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = hidden().tempfile_in(folder.unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    // The name must not reach the disk before the bytes do.
    file.as_file().sync_all()?;
    file.persist(path).map(drop).map_err(|failed| failed.error)
}

fn hidden() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".softrast-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private by default; results are as readable as any new file.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
}

/// The folder for the results of a command, in which files appear together, each whole or not at all.
///
/// Files are first written under hidden names, and get their own in [`commit`](OutputFolder::commit), where results of an earlier run of
/// the command that this one does not have are removed. Without it nothing stays behind, not even the folder if it was made for this.
pub struct OutputFolder {
    path: PathBuf,
    /// Program and command.
    command: String,
    inputs: Inputs,
    made: Vec<PathBuf>,
    /// Whether the list of results was made for this.
    lists: bool,
    staged: Vec<(String, NamedTempFile)>,
}

impl OutputFolder {
    /// Makes the folder if it is missing, and makes sure that files can be written to it. `command` is whose results are replaced, such as
    /// `pose evaluate`.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if they cannot.
    pub fn open(path: &Path, command: &str, inputs: &Inputs) -> Result<Self, Error> {
        let folder = Self::writable(path, command, inputs)?;
        folder.list()?;
        Ok(folder)
    }

    fn writable(path: &Path, command: &str, inputs: &Inputs) -> Result<Self, Error> {
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

    /// Where a file of this name is.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Makes sure that files of these names may be written: before the work, so that nobody waits for a refusal.
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

    /// Gives all files their names, and removes the results of earlier runs of the command that this one does not have.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if a file cannot be renamed or removed, [`Error::Taken`] as [`claim`](OutputFolder::claim). The earlier results are
    /// all in place then.
    pub fn commit(&mut self) -> Result<(), Error> {
        self.commit_beside(|_| false)
    }

    /// The same, but earlier results of these names stay.
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
            settled.result(name, &self.command, vec![new.clone()]);
            list.result(name, &self.command, before.into_iter().chain([new]).collect());
        }
        let mut stale = Vec::new();
        for name in list.results(&self.command) {
            if staged.iter().all(|(staged, _)| staged != name) && !stays(name) {
                // A file that the user has changed is no result any more; an input of this run is one still.
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
        // The list from before names the same files, so nothing is lost if it stays.
        let _ = self.write_list(&settled);
        Ok(())
    }

    /// Renames and removes; where that fails in the middle, all is undone.
    fn replace(&self, staged: Vec<(String, NamedTempFile)>, stale: &[String]) -> io::Result<()> {
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

    /// Writes a file at once that a later call goes on from. It stays where results are replaced.
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
        list.kept(name, &self.command, contents);
        self.write_list(&list)?;
        write_atomically(&path, bytes).map_err(|reason| self.refused(reason))
    }

    /// Lists a file as one that a later call goes on from: the caller has read it, and knows that it is.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if the file cannot be read or the list cannot be written, [`Error::Taken`] if it is an input or no regular file.
    pub fn adopt(&mut self, name: &str) -> Result<(), Error> {
        let mut list = self.list()?;
        let found = content(&self.file(name)).map_err(|reason| self.refused(reason))?;
        list.kept(name, &self.command, vec![found]);
        self.check(name, &list)?;
        self.write_list(&list)
    }

    /// The path of a file that grows while the command works and always begins with `begins`, as the records of finished runs.
    ///
    /// A command that `resumes` goes on with one that it finds, and sets aside, as `NAME.damaged`, one of its own that begins otherwise.
    ///
    /// # Errors
    ///
    /// [`Error::Folder`] if files cannot be read or written, [`Error::Taken`] as [`claim`](OutputFolder::claim).
    pub fn journal(&mut self, name: &str, begins: &str, resumes: bool) -> Result<PathBuf, Error> {
        let mut list = self.list()?;
        let path = self.file(name);
        let is_listed = list.names().any(|listed| listed == name);
        let mut with_it = list.clone();
        with_it.journal(name, &self.command, begins);
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
        list.journal(name, &self.command, begins);
        self.write_list(&list)?;
        Ok(path)
    }

    /// Whether a file is a journal of this command that begins otherwise now.
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

    /// Whether there is a file of this name that may be replaced.
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

    fn refused(&self, reason: io::Error) -> Error {
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
            // Fails where somebody else has put a file there meanwhile, which is right.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// The previous content of a path.
struct Before {
    path: PathBuf,
    /// The file under another name; none if there was none.
    file: Option<TempPath>,
}

impl Before {
    fn of(path: &Path) -> io::Result<Self> {
        if fs::symlink_metadata(path).is_err() {
            return Ok(Self { path: path.into(), file: None });
        }
        let folder = path.parent().unwrap_or(Path::new("."));
        // Not all file systems have links.
        let second = |hidden: &Path| {
            fs::hard_link(path, hidden).or_else(|_| fs::copy(path, hidden).map(drop))
        };
        let file = hidden().make_in(folder, second)?.into_temp_path();
        Ok(Self { path: path.into(), file: Some(file) })
    }

    fn restore(self) {
        // There is nothing left to try where this fails.
        let _ = match self.file {
            Some(file) => {
                let hidden = file.to_path_buf();
                let restored = file.persist(self.path).map_err(|failed| failed.error);
                // Two names of one file are not renamed into each other.
                let _ = fs::remove_file(hidden);
                restored
            }
            None => fs::remove_file(self.path),
        };
    }
}

/// A file that a flag names for a result; its folder is made if missing.
pub struct OutputFile {
    path: PathBuf,
    folder: OutputFolder,
}

impl OutputFile {
    /// Makes sure that it can be written: there is none, an empty one, or one of the same `kind` that the run does not read. `is_kind` says
    /// whether the file at a path is of the kind.
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

    /// Writes it, whole or not at all.
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn names(path: &Path) -> Vec<String> {
        let entries = fs::read_dir(path).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The content of every file but the list, by name.
    fn files(path: &Path) -> BTreeMap<String, String> {
        let names = names(path).into_iter().filter(|name| name != MANIFEST);
        names.map(|name| (name.clone(), fs::read_to_string(path.join(&name)).unwrap())).collect()
    }

    fn open(path: &Path, command: &str) -> OutputFolder {
        OutputFolder::open(path, command, &Inputs::default()).unwrap()
    }

    /// What a command that writes files of these names and contents comes to.
    fn run(path: &Path, command: &str, files: &[(&str, &str)]) -> Result<(), Error> {
        let mut folder = open(path, command);
        files.iter().try_for_each(|(name, text)| folder.stage(name, text.as_bytes()))?;
        folder.commit()
    }

    fn refusal(found: Result<(), Error>, part: &str) {
        let message = found.unwrap_err().to_string();
        assert!(message.contains(part) && message.lines().count() == 1, "{message}");
    }

    #[test]
    fn results_appear_together_and_replace_those_of_an_earlier_run() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("a/b");
        let mut folder = open(&out, "pose solve");
        folder.stage("a.gif", b"gif").unwrap();
        folder.stage("r.json", b"old").unwrap();
        assert!(!out.join("r.json").exists());
        folder.commit().unwrap();
        assert_eq!(names(&out), [MANIFEST, "a.gif", "r.json"]);

        fs::write(out.join("notes.txt"), "mine").unwrap();
        run(&out, "pose solve", &[("r.json", "new")]).unwrap();
        assert_eq!(names(&out), [MANIFEST, "notes.txt", "r.json"]);
        assert_eq!(fs::read(out.join("r.json")).unwrap(), b"new");
    }

    #[test]
    fn nothing_that_no_earlier_run_has_listed_is_replaced_or_removed() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        fs::write(out.join("r.json"), "mine").unwrap();
        fs::write(out.join("a.gif"), "mine").unwrap();
        let before = files(out);
        refusal(
            run(out, "pose solve", &[("b.csv", "b"), ("r.json", "r")]),
            "r.json is not a recorded",
        );
        refusal(open(out, "pose solve").claim(["b.csv", "a.gif"]), "a.gif is not a recorded");
        assert_eq!((files(out), names(out).len()), (before, 2));
    }

    #[test]
    fn a_result_that_the_user_has_changed_is_the_users() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        run(out, "pose solve", &[("r.json", "r"), ("a.gif", "a")]).unwrap();
        fs::write(out.join("r.json"), "mine").unwrap();
        let before = files(out);
        refusal(run(out, "pose solve", &[("r.json", "new")]), "r.json was changed");
        assert_eq!(files(out), before);
        // Neither is it removed.
        run(out, "pose solve", &[("b.csv", "b")]).unwrap();
        assert_eq!(names(out), [MANIFEST, "b.csv", "r.json"]);
        refusal(run(out, "pose solve", &[("r.json", "new")]), "r.json is not a recorded");
    }

    #[test]
    fn commands_that_share_a_folder_leave_each_others_results() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        run(out, "shape3d solve", &[("mesh.obj", "m"), ("r.json", "r")]).unwrap();
        refusal(run(out, "pose solve", &[("r.json", "p")]), "is a result of `shape3d solve`");
        run(out, "pose solve", &[("overlay.png", "p")]).unwrap();
        run(out, "shape3d solve", &[("r.json", "new")]).unwrap();
        assert_eq!(names(out), [MANIFEST, "overlay.png", "r.json"]);
    }

    #[test]
    fn an_input_is_never_replaced_or_removed_even_if_it_is_a_result() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        run(out, "learn", &[("softness.json", "s"), ("r.json", "r")]).unwrap();
        let mut inputs = Inputs::default();
        inputs.add(&out.join("softness.json"));
        let mut folder = OutputFolder::open(out, "learn", &inputs).unwrap();
        refusal(folder.claim(["softness.json"]), "is an input of this run");
        folder.stage("b.csv", b"b").unwrap();
        folder.commit().unwrap();
        assert_eq!(names(out), [MANIFEST, "b.csv", "softness.json"]);
        // It is a result still.
        run(out, "learn", &[("b.csv", "b")]).unwrap();
        assert_eq!(names(out), [MANIFEST, "b.csv"]);
    }

    #[test]
    fn an_error_amid_renaming_leaves_the_earlier_results_whole() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        run(out, "pose solve", &[("a", "1"), ("b", "1"), ("old", "1")]).unwrap();
        let before = files(out);
        let mut folder = open(out, "pose solve");
        for name in ["a", "b", "c", "d"] {
            folder.stage(name, b"2").unwrap();
        }
        // As if somebody had made it between the check and the renaming.
        let staged = std::mem::take(&mut folder.staged);
        fs::create_dir(out.join("d")).unwrap();
        assert!(folder.replace(staged, &["old".to_owned()]).is_err());
        fs::remove_dir(out.join("d")).unwrap();
        assert_eq!((files(out), names(out).len()), (before, 4), "nothing hidden is left");
        // A folder that was there before is told by its name.
        fs::create_dir(out.join("e")).unwrap();
        refusal(run(out, "pose solve", &[("a", "2"), ("e", "2")]), "e is a folder");
    }

    #[test]
    fn a_run_that_was_killed_at_any_moment_locks_nobody_out() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        run(out, "pose solve", &[("a", "old"), ("b", "old")]).unwrap();
        let [old, new] = ["old", "new"].map(|text| content_of(text.as_bytes()));
        let mut list = Manifest::of(out).unwrap();
        for name in ["a", "b", "c"] {
            list.result(name, "pose solve", vec![old.clone(), new.clone()]);
        }
        // The list is there, and some of the files have their names.
        fs::write(out.join(MANIFEST), list.text()).unwrap();
        fs::write(out.join("a"), "new").unwrap();
        run(out, "pose solve", &[("a", "last"), ("c", "last")]).unwrap();
        assert_eq!(names(out), [MANIFEST, "a", "c"]);
    }

    #[test]
    fn what_a_later_call_goes_on_from_stays_and_is_known_again() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        let mut folder = open(out, "learn");
        folder.keep("point.json", b"1").unwrap();
        let journal = folder.journal("steps.jsonl", "{\"step", false).unwrap();
        fs::write(&journal, "{\"step\":0}\n").unwrap();
        folder.keep("point.json", b"2").unwrap();
        drop(folder);
        run(out, "learn", &[("r.json", "r")]).unwrap();
        assert_eq!(names(out), [MANIFEST, "point.json", "r.json", "steps.jsonl"]);
        let mut folder = open(out, "learn");
        folder.claim(["point.json"]).unwrap();
        folder.journal("steps.jsonl", "{\"step", false).unwrap();
        fs::write(out.join("point.json"), "mine").unwrap();
        refusal(folder.keep("point.json", b"3"), "was changed");
        // One that begins otherwise is not replaced, and set aside where the command goes on.
        fs::write(&journal, "mine").unwrap();
        let fresh = folder.journal("steps.jsonl", "{\"step", false);
        refusal(fresh.map(drop), "was changed");
        folder.journal("steps.jsonl", "{\"step", true).unwrap();
        assert_eq!(fs::read(out.join("steps.jsonl.damaged")).unwrap(), b"mine");
        assert!(!journal.exists());
    }

    #[test]
    fn a_journal_without_a_list_is_gone_on_from_but_not_replaced() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path();
        fs::write(out.join("steps.jsonl"), "{\"step\":0}\n").unwrap();
        let fresh = open(out, "learn").journal("steps.jsonl", "{\"step", false);
        refusal(fresh.map(drop), "is not a recorded result");
        open(out, "learn").journal("steps.jsonl", "{\"step", true).unwrap();
        fs::write(out.join("mine.jsonl"), "mine").unwrap();
        let mine = open(out, "learn").journal("mine.jsonl", "{\"step", true);
        assert!(mine.is_err() && out.join("mine.jsonl").exists());
    }

    #[test]
    fn a_run_that_comes_to_nothing_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        let mut folder = open(&out, "learn");
        folder.journal("steps.jsonl", "{", false).unwrap();
        folder.stage("r.json", b"r").unwrap();
        drop(folder);
        assert!(!out.exists());
    }

    #[test]
    fn a_list_that_is_none_is_refused_and_names_that_lead_elsewhere_mean_nothing() {
        let root = tempfile::tempdir().unwrap();
        let (out, outside) = (root.path().join("out"), root.path().join("r.json"));
        run(&out, "pose solve", &[("r.json", "r")]).unwrap();
        fs::write(&outside, "r").unwrap();
        let list = fs::read_to_string(out.join(MANIFEST)).unwrap();
        fs::write(out.join(MANIFEST), list.replace("\"r.json", "\"../r.json")).unwrap();
        run(&out, "pose solve", &[("b", "b")]).unwrap();
        assert!(outside.exists());
        fs::write(out.join(MANIFEST), "{}").unwrap();
        let refused = OutputFolder::open(&out, "pose solve", &Inputs::default());
        refusal(refused.map(drop), "is not a list of results");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_in_the_place_of_a_result_is_the_users() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        run(&out, "pose solve", &[("r.json", "r")]).unwrap();
        fs::rename(out.join("r.json"), root.path().join("r.json")).unwrap();
        std::os::unix::fs::symlink(root.path().join("r.json"), out.join("r.json")).unwrap();
        refusal(run(&out, "pose solve", &[("r.json", "new")]), "not a regular file");
        assert_eq!(fs::read(root.path().join("r.json")).unwrap(), b"r");
    }

    #[test]
    fn a_file_that_is_named_replaces_one_of_its_kind_but_no_input() {
        let root = tempfile::tempdir().unwrap();
        let path = |name: &str| root.path().join(name);
        let is_png = |path: &Path| fs::read(path).unwrap().starts_with(b"png");
        let write = |name: &str, inputs: &Inputs| {
            OutputFile::open(&path(name), "PNG picture", is_png, inputs)?.write(b"png")
        };
        let none = Inputs::default();
        for (name, text) in [("a.png", "png of before"), ("b.obj", "v 0 0 0"), ("c.png", "png")] {
            fs::write(path(name), text).unwrap();
        }
        fs::write(path("empty.png"), "").unwrap();
        for name in ["a.png", "empty.png", "new/er/d.png"] {
            write(name, &none).unwrap();
            assert_eq!(fs::read(path(name)).unwrap(), b"png", "{name}");
        }
        refusal(write("b.obj", &none), "b.obj exists and is not a PNG picture");
        refusal(write("new", &none), "is a folder");
        let mut inputs = none;
        inputs.add(&path("c.png"));
        refusal(write("./new/../c.png", &inputs), "is an input of this run");
        assert!(OutputFile::open(&path("x/y.png"), "", is_png, &inputs).is_ok());
        assert!(!path("x").exists());
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_refused_and_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("file"), "").unwrap();
        let open = |name: &str| {
            OutputFolder::open(&root.path().join(name), "pose solve", &Inputs::default())
        };
        assert!(open("file/out").is_err() && open("file").is_err());
        fs::create_dir_all(root.path().join("out/r.json")).unwrap();
        let mut folder = open("out").unwrap();
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
