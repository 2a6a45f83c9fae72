use std::{
    collections::BTreeMap,
    ffi::OsStr,
    fs::{self, File, OpenOptions},
    io::{self, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;

use crate::{OutputFolder, Shard, checksum::checksum, write_atomically};

/// Finished work by key, in a file that outlives the program.
///
/// The file has a line of JSON for every piece, with its own checksum. Each line is written at once
/// and then synced: a program that is killed leaves at most half a line. Lines of several jobs may
/// share a file, in any order.
///
/// Each shard of a job writes a separate file in the same folder, `evaluate.3-of-8.jsonl` for
/// `evaluate.jsonl`, and reads those of all others.
pub struct Store<T> {
    path: Option<PathBuf>,
    shard: Option<Shard>,
    found: BTreeMap<String, T>,
    /// Whether the existing content of the file is kept.
    appends: bool,
    /// Read positions in the files of shards.
    read: BTreeMap<PathBuf, u64>,
}

/// A line of the file without its checksum.
#[derive(Serialize, Deserialize)]
struct Entry<T> {
    key: String,
    name: String,
    #[serde(flatten)]
    value: T,
}

impl<T: Clone + Serialize + DeserializeOwned> Store<T> {
    /// A store without a file.
    pub fn in_memory() -> Self {
        let (found, read) = (BTreeMap::new(), BTreeMap::new());
        Self { path: None, shard: None, found, appends: false, read }
    }

    /// An empty store, which replaces the file once a piece is finished.
    pub fn fresh(path: &Path) -> Self {
        Self { path: Some(path.into()), ..Self::in_memory() }
    }

    /// Reads the file and those of shards, if there are any, and returns a note on damaged lines.
    /// Damaged lines are removed from the file, but not from those of shards, which may be running.
    ///
    /// # Errors
    ///
    /// If a file cannot be read, or damaged lines cannot be removed.
    pub fn open(path: &Path) -> anyhow::Result<(Self, Option<String>)> {
        let mut store = Self { appends: true, ..Self::fresh(path) };
        let is_there = path.exists();
        let mut lines = if is_there { store.read(path, 0)? } else { Lines::default() };
        if lines.intact.len() < lines.bytes {
            write_atomically(path, &lines.intact)
                .with_context(|| format!("cannot write {path:?}"))?;
        }
        let of_shards = store.refresh()?;
        lines.damaged += of_shards.damaged;
        lines.whole += of_shards.whole;
        let note = match (is_there || !store.read.is_empty(), lines.damaged) {
            (false, _) => Some(format!("there is no {}, so nothing to go on from", path.display())),
            (true, 0) => None,
            (true, damaged) => Some(format!(
                "{damaged} of {} lines of {} are damaged: the runs that they held are made anew",
                damaged + lines.whole,
                path.display()
            )),
        };
        Ok((store, note))
    }

    /// The store of a command in its folder: that of its shard, else the existing one if it
    /// resumes, else a fresh one; and a note on damaged lines.
    ///
    /// # Errors
    ///
    /// As [`Store::open`] and [`Store::of_shard`]; if the file is not the command's.
    pub fn of_command(
        folder: &mut OutputFolder,
        name: &str,
        shard: Option<Shard>,
        resumes: bool,
    ) -> anyhow::Result<(Self, Option<String>)> {
        let path = folder.file(name);
        if let Some(shard) = shard {
            return Ok((Self::of_shard(&path, shard)?, None));
        }
        let path = folder.journal(name, HEAD, resumes)?;
        if resumes { Self::open(&path) } else { Ok((Self::fresh(&path), None)) }
    }

    /// The pieces in all files of the job, for a shard to continue from; it writes a new file.
    ///
    /// # Errors
    ///
    /// If a file cannot be read or the new one made.
    pub fn of_shard(path: &Path, shard: Shard) -> anyhow::Result<Self> {
        let mut store = Self { shard: Some(shard), appends: true, ..Self::in_memory() };
        if path.exists() {
            store.read(path, 0)?;
        }
        store.path = Some(new_file(path, shard)?);
        store.refresh()?;
        Ok(store)
    }

    /// The shard of this store.
    pub fn shard(&self) -> Option<Shard> {
        self.shard
    }

    /// The piece of this key, if it is finished.
    pub fn get(&self, key: &str) -> Option<&T> {
        self.found.get(key)
    }

    /// Stores a piece; `name` is for human readers of the file.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn put(&mut self, key: &str, name: &str, value: &T) -> anyhow::Result<()> {
        let (key, name) = (key.to_owned(), name.to_owned());
        if let Some(path) = self.path.clone() {
            let entry = Entry { key: key.clone(), name, value: value.clone() };
            let body = serde_json::to_string(&entry)?;
            let line = format!("{HEAD}{}{MIDDLE}{body}}}\n", checksum(body.as_bytes()));
            self.append(&path, &line).with_context(|| format!("cannot write to {path:?}"))?;
        }
        self.found.insert(key, value.clone());
        Ok(())
    }

    /// Number of finished pieces on file.
    pub fn kept(&self) -> usize {
        if self.path.is_some() { self.found.len() } else { 0 }
    }

    /// Reads new lines of other shards; empty without a file.
    ///
    /// # Errors
    ///
    /// If a file cannot be read.
    pub(crate) fn refresh(&mut self) -> anyhow::Result<Lines> {
        let mut all = Lines::default();
        let Some(path) = self.path.clone() else { return Ok(all) };
        for file in files_of_shards(&path)? {
            let from = self.read.get(&file).copied().unwrap_or(0);
            let lines = self.read(&file, from)?;
            self.read.insert(file, from + lines.end as u64);
            all.whole += lines.whole;
            all.damaged += lines.damaged;
        }
        Ok(all)
    }

    /// Reads the lines of a file from a byte on. Of two lines with one key the last counts.
    fn read(&mut self, path: &Path, from: u64) -> anyhow::Result<Lines> {
        let named = || format!("cannot read {path:?}");
        // Opening a pipe could block for ever.
        ensure!(fs::metadata(path).with_context(named)?.is_file(), "{path:?} is no regular file");
        let mut file = File::open(path).with_context(named)?;
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(from))
            .and_then(|_| file.read_to_end(&mut bytes))
            .with_context(named)?;
        // Bytes after the last line feed are still being written, or were when the program was killed.
        let end = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let mut lines = Lines { bytes: bytes.len(), end, ..Lines::default() };
        for line in bytes[..end].split_inclusive(|&byte| byte == b'\n') {
            match entry::<T>(&line[..line.len() - 1]) {
                Some(Entry { key, value, .. }) => {
                    self.found.insert(key, value);
                    lines.intact.extend_from_slice(line);
                    lines.whole += 1;
                }
                None => lines.damaged += 1,
            }
        }
        Ok(lines)
    }

    fn append(&mut self, path: &Path, line: &str) -> io::Result<()> {
        if !self.appends {
            // A new file under the old name: another link to the old file stays as it is.
            write_atomically(path, line.as_bytes())?;
            self.appends = true;
            return Ok(());
        }
        let mut file = OpenOptions::new().append(true).create(true).open(path)?;
        file.write_all(line.as_bytes())?;
        file.sync_data()
    }
}

/// Result of reading a file.
#[derive(Default)]
pub(crate) struct Lines {
    /// Number of bytes, and of those in whole lines.
    bytes: usize,
    end: usize,
    /// The bytes of the undamaged lines, and the numbers of lines.
    intact: Vec<u8>,
    whole: usize,
    damaged: usize,
}

/// The files of shards next to a file, in the order of their names.
fn files_of_shards(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let job = job(path);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {folder:?}"))? {
        let file = entry?.path();
        let name = file.file_name().and_then(OsStr::to_str).unwrap_or_default();
        let of_shard = name.strip_prefix(job).and_then(|rest| rest.strip_prefix('.'));
        if of_shard.and_then(|rest| rest.strip_suffix(SUFFIX)).is_some_and(Shard::is_in_name) {
            files.push(file);
        }
    }
    files.sort();
    Ok(files)
}

/// A new file of a shard. Another process may be running the same shard, with its own file.
fn new_file(path: &Path, shard: Shard) -> anyhow::Result<PathBuf> {
    let (job, shard) = (job(path), shard.in_name());
    for k in 1.. {
        let again = if k == 1 { String::new() } else { format!(".{k}") };
        let file = path.with_file_name(format!("{job}.{shard}{again}{SUFFIX}"));
        match File::create_new(&file) {
            Ok(_) => return Ok(file),
            Err(taken) if taken.kind() == io::ErrorKind::AlreadyExists => {}
            Err(failed) => return Err(failed).with_context(|| format!("cannot make {file:?}")),
        }
    }
    unreachable!("there is a number that is not taken")
}

/// The name of a file up to its first dot: `evaluate` of `evaluate.jsonl` and of `evaluate.3-of-8.jsonl`.
fn job(path: &Path) -> &str {
    let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
    name.split('.').next().unwrap_or_default()
}

const SUFFIX: &str = ".jsonl";

/// A hash of the inputs that determine some results, as their key.
pub fn key(identity: &Value) -> String {
    checksum(identity.to_string().as_bytes())
}

/// Beginning of every file.
pub(crate) const HEAD: &str = "{\"checksum\":\"";
const MIDDLE: &str = "\",\"finished\":";

/// The content of a line, if it is undamaged.
fn entry<T: DeserializeOwned>(line: &[u8]) -> Option<Entry<T>> {
    let line = line.strip_prefix(HEAD.as_bytes())?;
    let (sum, line) = line.split_at_checked(16)?;
    let body = line.strip_prefix(MIDDLE.as_bytes())?.strip_suffix(b"}")?;
    if sum != checksum(body).as_bytes() {
        return None;
    }
    serde_json::from_slice(body).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Piece {
        values: Vec<f64>,
    }

    fn piece(k: u64) -> Piece {
        Piece { values: vec![0.1 + 0.2, -0.0, 1e-300 / 7.0, k as f64] }
    }

    #[test]
    fn a_run_that_was_stored_with_an_older_name_of_its_restarts_is_read() {
        let run = r#""run":{"seed":3,"curve":[],"success":true,"step_seconds":[],"begun_again":[2,5],"warnings":[],"broke_at":null}"#;
        let body = format!(r#"{{"key":"k","name":"gauss",{run},"seconds":1.5,"pictures":null}}"#);
        let line = format!("{HEAD}{}{MIDDLE}{body}}}", checksum(body.as_bytes()));
        let Entry { value, .. } = entry::<crate::evaluate::Finished>(line.as_bytes()).unwrap();
        assert_eq!(value.run.restarts, [2, 5]);
    }

    fn shard(text: &str) -> Shard {
        Shard::parse(text).unwrap()
    }

    /// A folder, and the path of a file in it with three pieces.
    fn written() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.jsonl");
        let mut store = Store::fresh(&path);
        for k in [u64::MAX, 1, 2] {
            store.put(&k.to_string(), "method", &piece(k)).unwrap();
        }
        (folder, path)
    }

    fn open(path: &Path) -> (Store<Piece>, Option<String>) {
        Store::open(path).unwrap()
    }

    #[test]
    fn pieces_come_back_to_the_last_bit_and_more_can_follow() {
        let (_folder, path) = written();
        let (mut store, note) = open(&path);
        assert_eq!((note, store.kept()), (None, 3));
        assert_eq!(store.get(&u64::MAX.to_string()), Some(&piece(u64::MAX)));
        assert_eq!(store.get("3"), None);
        store.put("3", "other", &piece(3)).unwrap();
        assert_eq!(open(&path).0.kept(), 4);
        Store::fresh(&path).put("7", "method", &piece(7)).unwrap();
        assert_eq!(open(&path).0.kept(), 1);
    }

    #[test]
    fn a_damaged_line_is_counted_and_the_rest_is_kept() {
        let (_folder, path) = written();
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replacen("2.0]", "3.0]", 1)).unwrap();
        let (store, note) = open(&path);
        assert!(note.unwrap().contains("1 of 3 lines"));
        assert!(store.get("2").is_none() && store.get("1").is_some());
        assert_eq!(open(&path).1, None);
    }

    #[test]
    fn shards_write_files_of_their_own_and_read_those_of_all() {
        let (folder, path) = written();
        let mut one = Store::of_shard(&path, shard("1/2")).unwrap();
        let mut other = Store::of_shard(&path, shard("2/2")).unwrap();
        let mut twice = Store::of_shard(&path, shard("2/2")).unwrap();
        assert_eq!([one.kept(), other.kept()], [3, 3]);
        one.put("a", "method", &piece(10)).unwrap();
        other.put("b", "method", &piece(11)).unwrap();
        twice.put("c", "method", &piece(12)).unwrap();
        assert!(one.get("b").is_none());
        one.refresh().unwrap();
        assert_eq!(
            (one.get("b"), one.get("c"), one.kept()),
            (Some(&piece(11)), Some(&piece(12)), 6)
        );
        // An incomplete line is read once it is complete.
        let file = folder.path().join("runs.2-of-2.jsonl");
        let whole = fs::read_to_string(&file).unwrap();
        other.put("d", "method", &piece(13)).unwrap();
        let more = fs::read_to_string(&file).unwrap();
        fs::write(&file, &more[..whole.len() + 20]).unwrap();
        one.refresh().unwrap();
        assert_eq!(one.get("d"), None);
        fs::write(&file, more).unwrap();
        one.refresh().unwrap();
        assert_eq!(one.get("d"), Some(&piece(13)));
        assert_eq!(open(&path).0.kept(), 7);
        let names = ["runs.1-of-2.jsonl", "runs.2-of-2.2.jsonl", "runs.2-of-2.jsonl"];
        let found = files_of_shards(&path).unwrap();
        assert!(found.iter().map(|file| file.file_name().unwrap()).eq(names));
    }
}
