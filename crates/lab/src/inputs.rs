//! The input files of a run, none of which it may replace or remove.

use std::{
    ffi::{OsStr, OsString},
    fs,
    path::{Path, PathBuf},
};

use serde_json::Value;

/// The input files of a run.
///
/// They are compared by identity and not by name, so that links and detours (`./x/../a.png`) make no difference.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    files: Vec<PathBuf>,
}

impl Inputs {
    /// Every file named by a word of a command line, by itself or as a part of it (`--flag=FILE`, `FILE,FILE`,
    /// `"FILE --flag 1"`), except after the flags of results. New flags are therefore protected without further code.
    ///
    /// Files in a folder that a flag names are not included: a result never replaces a file that no manifest lists.
    pub fn of_words(words: &[OsString], outputs: &[&str]) -> Self {
        let mut inputs = Self::default();
        let mut names_result = false;
        for word in words.iter().skip(1) {
            let of_result = |flag: &&str| {
                let rest = word.as_encoded_bytes().strip_prefix(flag.as_bytes());
                rest.is_some_and(|rest| rest.first() == Some(&b'='))
            };
            if !names_result && !outputs.iter().any(of_result) {
                parts(word).iter().for_each(|part| inputs.add(Path::new(part)));
            }
            names_result = outputs.iter().any(|flag| word == flag);
        }
        inputs
    }

    /// Adds a file, if it exists, and, if it is a mesh, the material and picture files that it refers to.
    pub fn add(&mut self, path: &Path) {
        if !path.is_file() {
            return;
        }
        self.files.push(path.to_owned());
        let folder = path.parent().unwrap_or(Path::new(""));
        let named = match path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase) {
            Some(ending) if ending == "obj" => of_obj(path, folder),
            Some(ending) if ending == "glb" => of_glb(path),
            Some(ending) if ending == "gltf" => of_json(&fs::read(path).unwrap_or_default()),
            _ => Vec::new(),
        };
        // The file name alone too: readers look there for files outside the folder.
        for name in named.iter().map(|name| name.replace('\\', "/")) {
            let last = name.rsplit('/').next().unwrap_or_default();
            self.files.extend([&*name, last].map(|name| folder.join(name)));
        }
    }

    /// Whether the file at a path is one of them.
    pub fn holds(&self, path: &Path) -> bool {
        let Some(id) = identity(path) else { return false };
        self.files.iter().any(|file| identity(file).as_ref() == Some(&id))
    }
}

/// The identity of a file; `None` if it does not exist.
#[cfg(unix)]
fn identity(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(path).ok().map(|found| (found.dev(), found.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<PathBuf> {
    fs::canonicalize(path).ok()
}

/// A word, and its parts between commas, spaces and after a `=`.
fn parts(word: &OsStr) -> Vec<OsString> {
    let mut all = vec![word.to_owned()];
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        let bytes = word.as_bytes();
        let value = bytes.iter().position(|&byte| byte == b'=').map(|at| &bytes[at + 1..]);
        for text in [Some(bytes), value].into_iter().flatten() {
            let commas = text.split(|byte| *byte == b',');
            let words = text.split(|byte| b", ".contains(byte));
            all.extend(commas.chain(words).map(|part| OsStr::from_bytes(part).to_owned()));
        }
        all.extend(value.map(|value| OsStr::from_bytes(value).to_owned()));
    }
    #[cfg(not(unix))]
    if let Some(text) = word.to_str() {
        let value = text.split_once('=').map(|(_, value)| value);
        for text in [Some(text), value].into_iter().flatten() {
            all.extend(text.split(',').chain(text.split([',', ' '])).map(OsString::from));
        }
        all.extend(value.map(OsString::from));
    }
    all
}

/// The rest of each line whose first word satisfies `begins`.
fn lines(path: &Path, begins: impl Fn(&str) -> bool) -> Vec<String> {
    let text = fs::read(path).unwrap_or_default();
    let line = |line: &[u8]| {
        // Most lines of a mesh are numbers.
        let first = line.iter().find(|byte| !byte.is_ascii_whitespace())?;
        if !first.is_ascii_alphabetic() || line.len() > 4096 {
            return None;
        }
        let line = String::from_utf8_lossy(line);
        let (word, rest) = line.trim().split_once(char::is_whitespace)?;
        begins(word).then(|| rest.trim().to_owned())
    };
    text.split(|&byte| byte == b'\n').filter_map(line).collect()
}

/// The material files that an OBJ file refers to, and their pictures, with or without options.
fn of_obj(path: &Path, folder: &Path) -> Vec<String> {
    let mut named = lines(path, |word| word == "mtllib");
    for library in named.clone() {
        let library = folder.join(library.replace('\\', "/"));
        if library.is_file() {
            for picture in lines(&library, |word| word.to_ascii_lowercase().starts_with("map_")) {
                named.extend(picture.split_whitespace().next_back().map(str::to_owned));
                named.push(picture);
            }
        }
    }
    named
}

/// The pictures and buffers that a GLB file refers to.
fn of_glb(path: &Path) -> Vec<String> {
    let bytes = fs::read(path).unwrap_or_default();
    let length = bytes.get(12..16).and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes);
    let end = length.map_or(0, |length| 20_usize.saturating_add(length as usize));
    of_json(bytes.get(20..end).unwrap_or_default())
}

/// The files that the JSON of a glTF file refers to, literally and with percent-decoding.
fn of_json(text: &[u8]) -> Vec<String> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let Ok(json) = serde_json::from_slice::<Value>(text) else { return Vec::new() };
    let lists = ["images", "buffers"].map(|key| json[key].as_array().cloned().unwrap_or_default());
    let named = lists.iter().flatten().filter_map(|one| one["uri"].as_str());
    let named = named.filter(|uri| !uri.starts_with("data:"));
    named.flat_map(|uri| [uri.to_owned(), decoded(uri)]).collect()
}

/// A text with its escapes, `%` and two hexadecimal digits, decoded to bytes.
fn decoded(uri: &str) -> String {
    let mut parts = uri.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        match part.get(..2).and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => bytes.extend([&[byte], &part.as_bytes()[2..]].concat()),
            None => bytes.extend([b"%", part.as_bytes()].concat()),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(words: &[&str]) -> Vec<OsString> {
        ["pose"].iter().chain(words).map(OsString::from).collect()
    }

    #[test]
    fn every_word_that_names_a_file_names_an_input_except_behind_a_result() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        for name in ["a.obj", "b.json", "c d.json", "e,f.png", "g.png", "h.png", "i=j.png"] {
            fs::write(path(name), name).unwrap();
        }
        let inputs = Inputs::of_words(
            &words(&[
                &path("a.obj"),
                &format!("--softness={}", path("b.json")),
                "--methods",
                &format!("gauss --scale 1,{},mlp", path("c d.json")),
                &path("e,f.png"),
                &format!("--out={}", path("g.png")),
                "--out",
                &path("h.png"),
                &path("i=j.png"),
            ]),
            &["--out"],
        );
        for name in ["a.obj", "b.json", "c d.json", "e,f.png", "i=j.png"] {
            assert!(inputs.holds(Path::new(&path(name))), "{name}");
        }
        for name in ["g.png", "h.png", "none"] {
            assert!(!inputs.holds(Path::new(&path(name))), "{name}");
        }
        let with_flags = format!("{} --scale 1", path("b.json"));
        assert!(Inputs::of_words(&words(&[&with_flags]), &[]).holds(Path::new(&path("b.json"))));
    }

    #[cfg(unix)]
    #[test]
    fn links_and_detours_lead_to_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("x")).unwrap();
        fs::write(path("a"), "").unwrap();
        std::os::unix::fs::symlink(path("a"), path("soft")).unwrap();
        fs::hard_link(path("a"), path("hard")).unwrap();
        for input in ["a", "soft", "hard", "x/../a"] {
            let mut inputs = Inputs::default();
            inputs.add(&path(input));
            for name in ["a", "soft", "hard", "./x/../a"] {
                assert!(inputs.holds(&path(name)), "{input} and {name}");
            }
            assert!(!inputs.holds(&path("x")));
        }
    }

    #[test]
    fn what_a_mesh_names_is_read_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("a.obj"), "mtllib my file.mtl\nv 0 0 0\n").unwrap();
        fs::write(path("my file.mtl"), "newmtl a\n  map_Kd -s 1 1 1 ..\\other\\a.png\n").unwrap();
        for name in ["a.png", "b.png"] {
            fs::write(path(name), "").unwrap();
        }
        let json = br#"{"images":[{"uri":"b.png"},{"bufferView":0}]}"#;
        let head = [*b"glTF", [2, 0, 0, 0], [0; 4], [json.len() as u8, 0, 0, 0], *b"JSON"];
        fs::write(path("b.glb"), [head.as_flattened(), json].concat()).unwrap();
        let mut inputs = Inputs::default();
        inputs.add(&path("a.obj"));
        assert!(inputs.holds(&path("my file.mtl")) && inputs.holds(&path("a.png")));
        assert!(!inputs.holds(&path("b.png")));
        inputs.add(&path("b.glb"));
        assert!(inputs.holds(&path("b.png")));
        let json =
            r#"{"images":[{"uri":"my%20c.png"}],"buffers":[{"uri":"c.bin"},{"uri":"data:,"}]}"#;
        for (name, text) in [("c.gltf", json), ("c.bin", ""), ("my c.png", "")] {
            fs::write(path(name), text).unwrap();
        }
        assert!(!inputs.holds(&path("c.bin")) && !inputs.holds(&path("my c.png")));
        inputs.add(&path("c.gltf"));
        assert!(inputs.holds(&path("c.bin")) && inputs.holds(&path("my c.png")));
    }
}
