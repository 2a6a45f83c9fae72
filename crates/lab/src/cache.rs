use std::{
    collections::BTreeMap,
    fs::{self, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
};

use anyhow::Context;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{Encoded, Run, write_atomically};

/// Finished runs by experiment and seed, in a file that outlives the program.
///
/// The file has a line of JSON for every run, which holds a checksum of itself. A line is written at once and then synced: a program
/// that is killed leaves half a line at most. Lines of several experiments may stand in one file, in any order.
pub struct Cache {
    path: Option<PathBuf>,
    runs: BTreeMap<(String, u64), Finished>,
    /// Whether what the file held before stays.
    appends: bool,
}

/// A run that is finished, and its pictures if it was asked for them.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Finished {
    pub(crate) run: Run,
    /// Wall time, with errors and pictures: its share of the batch.
    pub(crate) seconds: f64,
    pub(crate) pictures: Option<Encoded>,
}

/// A line of the file but for its checksum.
#[derive(Serialize, Deserialize)]
struct Entry {
    experiment: String,
    name: String,
    #[serde(flatten)]
    finished: Finished,
}

impl Cache {
    /// One that keeps nothing on file.
    pub fn in_memory() -> Self {
        Self { path: None, runs: BTreeMap::new(), appends: false }
    }

    /// An empty one, which replaces the file as soon as a run is finished.
    pub fn fresh(path: &Path) -> Self {
        Self { path: Some(path.into()), ..Self::in_memory() }
    }

    /// What stands in the file, if there is one, and a word on lines that are damaged. Those are taken out of the file.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, or damaged lines cannot be taken out.
    pub fn open(path: &Path) -> anyhow::Result<(Self, Option<String>)> {
        let mut cache = Self { appends: true, ..Self::fresh(path) };
        let bytes = match fs::read(path) {
            Err(missing) if missing.kind() == io::ErrorKind::NotFound => {
                let nothing = format!("there is no {}, so nothing to go on from", path.display());
                return Ok((cache, Some(nothing)));
            }
            bytes => bytes.with_context(|| format!("cannot read {path:?}"))?,
        };
        // What stands behind the last line feed was being written when the program was killed.
        let end = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let (mut intact, mut damaged, mut lines) = (Vec::new(), Vec::new(), 0);
        for (k, line) in bytes[..end].split_inclusive(|&byte| byte == b'\n').enumerate() {
            lines += 1;
            match entry(&line[..line.len() - 1]) {
                Some(Entry { experiment, finished, .. }) => {
                    cache.runs.insert((experiment, finished.run.seed), finished);
                    intact.extend_from_slice(line);
                }
                None => damaged.push(k + 1),
            }
        }
        if intact.len() < bytes.len() {
            write_atomically(path, &intact).with_context(|| format!("cannot write {path:?}"))?;
        }
        let note = damaged.first().map(|first| {
            format!(
                "{} of {lines} lines of {} are damaged, the first is line {first}: the runs that they held are made anew",
                damaged.len(),
                path.display()
            )
        });
        Ok((cache, note))
    }

    /// The run of this seed, if it is finished.
    pub(crate) fn get(&self, experiment: &str, seed: u64) -> Option<&Finished> {
        self.runs.get(&(experiment.to_owned(), seed))
    }

    /// Keeps a run.
    pub(crate) fn put(
        &mut self,
        experiment: &str,
        name: &str,
        finished: &Finished,
    ) -> anyhow::Result<()> {
        let (experiment, name) = (experiment.to_owned(), name.to_owned());
        let key = (experiment.clone(), finished.run.seed);
        if let Some(path) = self.path.clone() {
            let body =
                serde_json::to_string(&Entry { experiment, name, finished: finished.clone() })?;
            let line = format!("{HEAD}{}{MIDDLE}{body}}}\n", checksum(body.as_bytes()));
            self.append(&path, &line).with_context(|| format!("cannot write to {path:?}"))?;
        }
        self.runs.insert(key, finished.clone());
        Ok(())
    }

    /// How many runs are finished and kept on file.
    pub fn kept(&self) -> usize {
        if self.path.is_some() { self.runs.len() } else { 0 }
    }

    fn append(&mut self, path: &Path, line: &str) -> io::Result<()> {
        let mut options = OpenOptions::new();
        match self.appends {
            true => options.append(true),
            false => options.write(true).truncate(true),
        };
        let mut file = options.create(true).open(path)?;
        self.appends = true;
        file.write_all(line.as_bytes())?;
        file.sync_data()
    }
}

/// What an experiment's runs are kept under: a hash of its identity.
pub(crate) fn key(identity: &Value) -> String {
    checksum(identity.to_string().as_bytes())
}

/// FNV-1a, which is enough against damage.
pub(crate) fn checksum(bytes: &[u8]) -> String {
    let mix = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
    format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix))
}

const HEAD: &str = "{\"checksum\":\"";
const MIDDLE: &str = "\",\"finished\":";

/// What a line holds, if it is as it was written.
fn entry(line: &[u8]) -> Option<Entry> {
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
    use crate::Point;

    fn finished(seed: u64) -> Finished {
        let point =
            |step: usize| Point { step, values: vec![0.1 + 0.2, -0.0, 1e-300 / 7.0, seed as f64] };
        let run = Run {
            seed,
            curve: vec![point(0), point(1)],
            success: true,
            step_seconds: vec![0.5],
            warnings: vec!["one".into()],
            ..Run::default()
        };
        Finished { run, seconds: 1.0 / 3.0, pictures: None }
    }

    /// A folder, and the path of a file in it that holds three runs.
    fn written() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.jsonl");
        let mut cache = Cache::fresh(&path);
        for seed in [u64::MAX, 1, 2] {
            cache.put("a", "method", &finished(seed)).unwrap();
        }
        (folder, path)
    }

    fn found(cache: &Cache, seed: u64) -> Option<Run> {
        cache.get("a", seed).map(|finished| finished.run.clone())
    }

    #[test]
    fn runs_come_back_to_the_last_bit_and_more_can_follow() {
        let (_folder, path) = written();
        let (mut cache, note) = Cache::open(&path).unwrap();
        assert_eq!((note, cache.kept()), (None, 3));
        assert_eq!(found(&cache, u64::MAX), Some(finished(u64::MAX).run));
        assert!(cache.get("b", 1).is_none());
        cache.put("b", "other", &finished(1)).unwrap();
        assert_eq!(Cache::open(&path).unwrap().0.kept(), 4);
        Cache::fresh(&path).put("a", "method", &finished(7)).unwrap();
        assert_eq!(Cache::open(&path).unwrap().0.kept(), 1);
    }

    #[test]
    fn a_damaged_line_is_named_and_the_rest_is_kept() {
        let (_folder, path) = written();
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replacen("0.5", "0.6", 2).replacen("0.6", "0.5", 1)).unwrap();
        let (cache, note) = Cache::open(&path).unwrap();
        assert!(note.unwrap().contains("1 of 3 lines") && found(&cache, 1).is_none());
        assert!(found(&cache, 2).is_some() && found(&cache, u64::MAX).is_some());
        assert_eq!(Cache::open(&path).unwrap().1, None);
    }
}
