//! The list of results in an output folder, each with its command.
//!
//! A run replaces and removes only files that an earlier run of the same command has listed, in `.softrast.json` in the
//! folder, and that still have the recorded content: their length and a checksum. A file that a user has changed, or
//! created under the name of a result, is the user's. So is everything in a folder without a list.
//!
//! The list is written before the files: while a run writes, it has the old and the new content of each file. A program
//! that is killed at any moment leaves files of either content, which the next run recognizes as results.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, Read},
    path::{Component, Path},
};

use serde::{Deserialize, Serialize};

use crate::checksum::checksum;

/// Name of the list.
pub(crate) const MANIFEST: &str = ".softrast.json";

const ABOUT: &str = "Results in this folder, by the command that wrote them. A run of the command replaces and removes these files, as long as \
                     nobody has changed them, and no others.";

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Manifest {
    about: String,
    files: BTreeMap<String, Entry>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Program and command.
    by: String,
    what: What,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum What {
    /// A result, and its possible contents.
    Result(Vec<String>),
    /// A file that a later call continues from: it remains when results are replaced.
    Kept(Vec<String>),
    /// A file that grows, and its beginning.
    Journal(String),
}

impl Default for Manifest {
    fn default() -> Self {
        Self { about: ABOUT.to_owned(), files: BTreeMap::new() }
    }
}

/// Owner of a file, from the view of a command.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// The command; the file is unchanged.
    Own,
    /// The command; the file has changed since.
    Changed,
    /// Another command.
    Other(String),
    /// The user: the file is not listed.
    User,
}

impl Manifest {
    /// The list of a folder; an empty one if it has none.
    pub(crate) fn of(folder: &Path) -> io::Result<Self> {
        let path = folder.join(MANIFEST);
        match fs::symlink_metadata(&path) {
            Err(missing) if missing.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(reason) => return Err(reason),
            Ok(found) if found.is_file() => {}
            Ok(_) => return Err(no_list()),
        }
        let mut list: Self = serde_json::from_slice(&fs::read(&path)?).map_err(|_| no_list())?;
        // A result is never outside the folder.
        list.files.retain(|name, _| is_name(name));
        Ok(list)
    }

    pub(crate) fn text(&self) -> Vec<u8> {
        let text = serde_json::to_vec_pretty(self);
        text.expect("a list of names is JSON")
    }

    /// The owner of the regular file of this name at `path`.
    pub(crate) fn owner(&self, name: &str, path: &Path, command: &str) -> io::Result<Owner> {
        let Some(Entry { by, what }) = self.files.get(name) else { return Ok(Owner::User) };
        if by != command {
            return Ok(Owner::Other(by.clone()));
        }
        let is_own = match what {
            What::Result(contents) | What::Kept(contents) => contents.contains(&content(path)?),
            What::Journal(head) => begins(path, head)?,
        };
        Ok(if is_own { Owner::Own } else { Owner::Changed })
    }

    /// Names of the results of a command.
    pub(crate) fn results<'a>(&'a self, command: &'a str) -> impl Iterator<Item = &'a str> {
        let results = self
            .files
            .iter()
            .filter(move |(_, entry)| entry.by == command && matches!(entry.what, What::Result(_)));
        results.map(|(name, _)| name.as_str())
    }

    /// All names.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.keys().map(String::as_str)
    }

    pub(crate) fn insert(&mut self, name: &str, command: &str, what: What) {
        self.files.insert(name.to_owned(), Entry { by: command.to_owned(), what });
    }

    pub(crate) fn remove(&mut self, name: &str) {
        self.files.remove(name);
    }
}

fn no_list() -> io::Error {
    io::Error::other(format!("{MANIFEST} in it is not a list of results"))
}

/// Whether it is a file name, and not a path that leads elsewhere.
pub(crate) fn is_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name)
        && name != MANIFEST
}

/// The record of a file's content: its length and a checksum.
pub(crate) fn content_of(bytes: &[u8]) -> String {
    format!("{}-{}", bytes.len(), checksum(bytes))
}

/// The record of the file at a path.
pub(crate) fn content(path: &Path) -> io::Result<String> {
    Ok(content_of(&fs::read(path)?))
}

/// Whether a file begins with `head` or is a prefix of it; an empty file is.
pub(crate) fn begins(path: &Path, head: &str) -> io::Result<bool> {
    let mut found = Vec::new();
    File::open(path)?.take(head.len() as u64).read_to_end(&mut found)?;
    Ok(head.as_bytes().starts_with(&found))
}
