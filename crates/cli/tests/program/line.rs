//! Runs a task by its command line.

use std::{collections::BTreeMap, ffi::OsString, fs, path::Path};

use serde_json::Value;
use softrast_cli::{Task, execute};
use softrast_lab::Failure;
use tempfile::TempDir;

/// Runs the task with the words of a line, results in `out`, and gives its standard output. A word
/// in which an underscore stands for a space is `'a_b'`.
pub(crate) fn run_in<T: Task>(out: &Path, line: &str) -> (String, Result<(), Failure>) {
    let word = |word: &str| match word.strip_prefix('\'').and_then(|w| w.strip_suffix('\'')) {
        Some(quoted) => quoted.replace('_', " ").into(),
        None => OsString::from(word),
    };
    let mut words: Vec<OsString> =
        [T::NAME].into_iter().chain(line.split_whitespace()).map(word).collect();
    words.extend([OsString::from("--quiet"), "--json".into(), "--out".into(), out.into()]);
    let mut stdout = Vec::new();
    let ended = execute::<T>(words, &mut stdout);
    (String::from_utf8(stdout).unwrap(), ended)
}

/// A line that succeeds: its folder and its JSON object.
pub(crate) fn solved<T: Task>(line: &str) -> (TempDir, Value) {
    let out = tempfile::tempdir().unwrap();
    let (stdout, ended) = run_in::<T>(out.path(), line);
    ended.unwrap();
    (out, json(&stdout))
}

/// The JSON object of the last line.
pub(crate) fn json(stdout: &str) -> Value {
    serde_json::from_str(stdout.lines().last().unwrap()).unwrap()
}

/// A JSON file of the folder.
pub(crate) fn file(out: &Path, name: &str) -> Value {
    serde_json::from_slice(&fs::read(out.join(name)).unwrap()).unwrap()
}

/// Every file of the folder, with its bytes.
pub(crate) fn files(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(out).unwrap().map(Result::unwrap);
    let files = entries.filter(|entry| entry.path().is_file());
    let name = |entry: &fs::DirEntry| entry.file_name().into_string().unwrap();
    files.map(|entry| (name(&entry), fs::read(entry.path()).unwrap())).collect()
}

/// A list of numbers.
pub(crate) fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// The object without fields that differ between runs.
pub(crate) fn timeless(mut json: Value) -> Value {
    fn strip(json: &mut Value) {
        match json {
            Value::Object(map) => {
                for key in ["seconds", "peak_memory_mib", "out"] {
                    map.remove(key);
                }
                map.values_mut().for_each(strip);
            }
            Value::Array(list) => list.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut json);
    json
}
