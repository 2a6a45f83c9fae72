use std::{
    collections::VecDeque,
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;

/// What a job has finished so far, in a file that outlives the program.
///
/// JSON lines: the first says what the job is, each other what one part of it led to, in the order
/// of the work. A job is deterministic, so that it can ask for its parts in the same order again. A
/// line is written at once and then synced; a program that is killed leaves half a line at most.
pub(crate) struct Journal {
    path: PathBuf,
    header: String,
    /// Lines of an earlier call that nobody has asked for yet, with their numbers.
    stored: VecDeque<(usize, String)>,
    /// Bytes at the start of the file that stay.
    kept: u64,
    /// Open once there is something to add.
    file: Option<File>,
    parts: usize,
}

/// A line behind the first.
#[derive(Serialize, Deserialize)]
struct Entry<R> {
    part: String,
    result: R,
}

impl Journal {
    /// A journal with nothing in it, which replaces the file as soon as a part is finished.
    pub(crate) fn fresh(path: &Path, job: &Value) -> Self {
        let (stored, header) = (VecDeque::new(), job.to_string());
        Self { path: path.into(), header, stored, kept: 0, file: None, parts: 0 }
    }

    /// The journal of an earlier call, or a fresh one if there is no such file.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, belongs to another job, or is no journal.
    pub(crate) fn resumed(path: &Path, job: &Value) -> anyhow::Result<Self> {
        let mut journal = Self::fresh(path, job);
        let text = match fs::read(path) {
            Ok(bytes) => bytes,
            Err(missing) if missing.kind() == io::ErrorKind::NotFound => return Ok(journal),
            Err(reason) => return Err(reason).with_context(|| format!("cannot read {path:?}")),
        };
        // What stands behind the last line feed was being written when the program was killed.
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let foreign = || format!("{path:?} is no journal of unfinished work: leave out --resume");
        let text = std::str::from_utf8(&text[..whole]).with_context(foreign)?;
        let mut lines = text.lines();
        let Some(header) = lines.next() else {
            return Ok(journal);
        };
        if header != journal.header {
            let found: Value = serde_json::from_str(header).with_context(foreign)?;
            let how = difference("", &found, job).unwrap_or_else(|| "the job differs".into());
            bail!(
                "{path:?} belongs to another job ({how}): give the flags of that job, or leave out \
                 --resume to start from the beginning"
            );
        }
        journal.stored = lines.enumerate().map(|(k, line)| (k + 2, line.to_owned())).collect();
        journal.kept = whole as u64;
        Ok(journal)
    }

    /// The next part, if an earlier call has finished it.
    ///
    /// # Errors
    ///
    /// If the next line is not what was written for that part.
    pub(crate) fn recall<R: DeserializeOwned>(&mut self, part: &str) -> anyhow::Result<Option<R>> {
        let Some((number, line)) = self.stored.pop_front() else {
            return Ok(None);
        };
        let damaged = || {
            format!(
                "line {number} of {:?} is damaged: delete it and all that follow, or leave out \
                 --resume to start from the beginning",
                self.path
            )
        };
        let entry: Entry<R> = serde_json::from_str(&line).with_context(damaged)?;
        ensure!(entry.part == part, "{}: it is about {:?}, not {part:?}", damaged(), entry.part);
        self.parts += 1;
        Ok(Some(entry.result))
    }

    /// Adds the result of a part.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub(crate) fn record<R: Serialize>(&mut self, part: &str, result: &R) -> anyhow::Result<()> {
        let entry = Entry { part: part.to_owned(), result };
        let mut text = serde_json::to_string(&entry).context("cannot write a result as JSON")?;
        text.push('\n');
        self.append(text).with_context(|| format!("cannot write to {:?}", self.path))?;
        self.parts += 1;
        Ok(())
    }

    /// Parts that are finished and in the file.
    pub(crate) fn parts(&self) -> usize {
        self.parts
    }

    fn append(&mut self, mut text: String) -> io::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => {
                // An earlier half line goes; a file without any whole line starts anew.
                let mut options = OpenOptions::new();
                let file = options.write(true).create(true).truncate(false).open(&self.path)?;
                file.set_len(self.kept)?;
                if self.kept == 0 {
                    text.insert_str(0, &format!("{}\n", self.header));
                }
                none.insert(file)
            }
        };
        // Not in append mode, so the position has to follow what was kept.
        io::Seek::seek(file, io::SeekFrom::End(0))?;
        file.write_all(text.as_bytes())?;
        file.sync_data()
    }
}

/// The first place where two JSON values differ, in words.
fn difference(at: &str, found: &Value, asked: &Value) -> Option<String> {
    let (Value::Object(found_map), Value::Object(asked_map)) = (found, asked) else {
        let at = if at.is_empty() { "it" } else { at };
        return (found != asked).then(|| match (found, asked) {
            (Value::Object(_), Value::Null) => format!("{at} is only there"),
            (Value::Null, Value::Object(_)) => format!("{at} is only here"),
            _ => format!("{at} is {found} there, {asked} here"),
        });
    };
    let nothing = Value::Null;
    let keys = asked_map.keys().chain(found_map.keys().filter(|k| !asked_map.contains_key(*k)));
    keys.into_iter().find_map(|key| {
        let at = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
        let of = |map: &serde_json::Map<_, _>| map.get(key).unwrap_or(&nothing).clone();
        difference(&at, &of(found_map), &of(asked_map))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn job() -> Value {
        json!({"task": "disc", "settings": {"scale": 0.1}})
    }

    /// A folder and the path of a journal in it that holds two parts.
    fn written() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("jobs.jsonl");
        let mut journal = Journal::fresh(&path, &job());
        journal.record("a", &1).unwrap();
        journal.record("b", &2).unwrap();
        (folder, path)
    }

    #[test]
    fn parts_come_back_in_order_and_more_can_follow() {
        let (_folder, path) = written();
        let mut journal = Journal::resumed(&path, &job()).unwrap();
        assert_eq!(journal.recall("a").unwrap(), Some(1));
        assert_eq!(journal.recall("b").unwrap(), Some(2));
        assert_eq!(journal.recall::<u8>("c").unwrap(), None);
        journal.record("c", &3).unwrap();
        assert_eq!((journal.parts(), fs::read_to_string(&path).unwrap().lines().count()), (3, 4));
    }

    #[test]
    fn half_a_line_at_the_end_is_dropped() {
        let (_folder, path) = written();
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() - 4]).unwrap();
        let mut journal = Journal::resumed(&path, &job()).unwrap();
        assert_eq!(journal.recall("a").unwrap(), Some(1));
        assert_eq!(journal.recall::<u8>("b").unwrap(), None);
        journal.record("b", &2).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
        fs::write(&path, &text[..20]).unwrap();
        let mut journal = Journal::resumed(&path, &job()).unwrap();
        assert_eq!(journal.recall::<u8>("a").unwrap(), None);
        journal.record("a", &1).unwrap();
        assert!(text.starts_with(&fs::read_to_string(&path).unwrap()));
    }

    #[test]
    fn another_job_and_damage_are_refused_with_a_reason() {
        let (_folder, path) = written();
        let refused = |job: &Value| Journal::resumed(&path, job).err().unwrap().to_string();
        let other = json!({"task": "disc", "settings": {"scale": 0.2}});
        let message = refused(&other);
        assert!(message.contains("settings.scale is 0.1 there, 0.2 here"), "{message}");

        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace("\"part\":\"a\"", "\"part\":\"z\"")).unwrap();
        let mut journal = Journal::resumed(&path, &job()).unwrap();
        let message = journal.recall::<u8>("a").unwrap_err().to_string();
        assert!(message.contains("line 2 of") && message.contains("\"z\", not \"a\""), "{message}");
        fs::write(&path, text.replace("\"result\":1", "\"result\":")).unwrap();
        let mut journal = Journal::resumed(&path, &job()).unwrap();
        assert!(journal.recall::<u8>("a").is_err());
        fs::write(&path, "seed,step\n1,2\n").unwrap();
        assert!(refused(&job()).contains("is no journal"));
    }

    #[test]
    fn a_missing_file_is_nothing_finished_and_stays_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("jobs.jsonl");
        let mut journal = Journal::resumed(&path, &job()).unwrap();
        assert_eq!(journal.recall::<u8>("a").unwrap(), None);
        assert!(!path.exists());
    }
}
