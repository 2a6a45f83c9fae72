//! Runs of a program in a folder with its inputs: none of the inputs is ever removed, replaced or truncated. Test files include this one.

use std::{
    collections::BTreeMap,
    ffi::{OsStr, OsString},
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// A mesh of few faces.
pub(crate) const OCTAHEDRON: &str = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n\
                                     f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";
/// A softness of one scale.
pub(crate) const SOFTNESS: &str =
    r#"{ "softness": { "family": "gauss", "squared": false }, "phi": [-3.0] }"#;

/// A program and the inputs of its flags.
pub(crate) struct Program {
    pub(crate) path: &'static str,
    /// Creates the inputs in a folder.
    pub(crate) inputs: fn(&Path),
    /// Words appended to every line, so that runs are short.
    pub(crate) short: &'static str,
}

impl Program {
    /// Runs a line in a folder. A word with spaces is written `'a_b'`, with underscores in their place.
    pub(crate) fn run(&self, folder: &Path, line: &str) -> Output {
        let word = |word: &str| match word.strip_prefix('\'').and_then(|w| w.strip_suffix('\'')) {
            Some(quoted) => quoted.replace('_', " ").into(),
            None => OsString::from(word),
        };
        let words: Vec<OsString> =
            line.split_whitespace().chain(self.short.split_whitespace()).map(word).collect();
        self.run_words(folder, &words)
    }

    pub(crate) fn run_words(&self, folder: &Path, words: &[OsString]) -> Output {
        Command::new(self.path).args(words).current_dir(folder).output().unwrap()
    }

    /// Runs each line twice, in a separate folder with the inputs. Existing files stay unchanged; a failing line changes nothing. Each line
    /// is followed by a part of its error, empty on success.
    pub(crate) fn keeps_inputs(&self, lines: &[(&str, &str)]) {
        for (line, error) in lines {
            let folder = tempfile::tempdir().unwrap();
            (self.inputs)(folder.path());
            let before = files(folder.path());
            for _again in 0..2 {
                let ended = self.run(folder.path(), line);
                let said = String::from_utf8_lossy(&ended.stderr).into_owned();
                let after = files(folder.path());
                for (path, bytes) in &before {
                    assert!(
                        after.get(path) == Some(bytes),
                        "{line}: {path:?} is not as it was: {said}"
                    );
                }
                if error.is_empty() {
                    assert!(ended.status.success(), "{line}: {said}");
                    assert!(after.len() > before.len(), "{line} has written nothing");
                } else {
                    assert!(!ended.status.success(), "{line} should end with {error:?}");
                    assert_eq!(said.trim_end().lines().count(), 1, "{line}: {said}");
                    assert!(said.contains(error), "{line}: {said}");
                    assert!(after == before, "{line} has written: {said}");
                }
            }
        }
    }

    /// Asserts that a line contains every flag whose value is a file or folder, according to the help of the commands.
    pub(crate) fn every_flag_is_in(&self, commands: &[&str], lines: &[(&str, &str)]) {
        for command in commands {
            let words: Vec<OsString> =
                command.split_whitespace().chain(["--help"]).map(OsString::from).collect();
            let help = self.run_words(Path::new("."), &words);
            let help = String::from_utf8(help.stdout).unwrap();
            let names_file = |line: &&str| {
                ["FILE", "DIR", "PICTURE", "MESH"].iter().any(|kind| line.contains(kind))
            };
            let flags = help.lines().map(str::trim).filter(|line| line.starts_with("--"));
            for flag in flags.filter(names_file).filter_map(|line| line.split(' ').next()) {
                let is_used =
                    lines.iter().any(|(line, _)| line.split(' ').any(|word| word == flag));
                assert!(is_used, "{command}: no line has {flag}, which names a file");
            }
        }
    }

    /// Names that are not UTF-8 or contain control codes are read, and never printed raw. `IN/` in a line is a folder of such a name with
    /// the inputs; a line fails if it contains `none`, which does not exist.
    #[cfg(unix)]
    pub(crate) fn prints_no_control_codes(&self, lines: &[&str]) {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join(OsStr::from_bytes(b"caf\xe9 \x1b[31m"));
        fs::create_dir(&folder).unwrap();
        (self.inputs)(&folder);
        for line in lines {
            let words = line.split_whitespace().chain(self.short.split_whitespace());
            let words: Vec<OsString> = words
                .map(|word| match word.strip_prefix("IN/") {
                    Some(name) => folder.join(name).into(),
                    None => word.into(),
                })
                .collect();
            let ended = self.run_words(root.path(), &words);
            let said = [ended.stdout.as_slice(), &ended.stderr].concat();
            let text = String::from_utf8_lossy(&said);
            assert!(!text.contains("panicked"), "{line}: {text}");
            assert_eq!(ended.status.success(), !line.contains("none"), "{line}: {text}");
            assert!(!said.contains(&0x1b), "{line} prints a control code: {text}");
        }
    }
}

/// All files below a folder, with their bytes.
pub(crate) fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => all.extend(files(&path)),
            false => drop(all.insert(path.clone(), fs::read(&path).unwrap())),
        }
    }
    all
}
