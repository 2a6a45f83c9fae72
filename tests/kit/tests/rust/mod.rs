//! The modules of a crate, and references between its files.

mod words;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use words::words;

/// The names that link each pair of files, by the referring file and the defining one.
pub(crate) type Links = BTreeMap<(PathBuf, PathBuf), BTreeSet<String>>;

/// Names of modules from the root of the crate.
type Module = Vec<String>;

/// A crate, module by module.
pub(crate) struct Crate {
    modules: BTreeMap<Module, Contents>,
}

/// Items and imports of a module.
#[derive(Default)]
struct Contents {
    file: PathBuf,
    /// Imports by their local names.
    imports: BTreeMap<String, Import>,
    globs: Vec<Import>,
    /// Names of the items defined here.
    items: BTreeSet<String>,
    /// Paths outside of imports.
    paths: BTreeSet<Vec<String>>,
    /// All words outside of imports.
    used: BTreeSet<String>,
}

struct Import {
    path: Vec<String>,
    is_public: bool,
}

/// The target of a path.
enum Found {
    Module(Module),
    /// The module that defines the item, and its name.
    Item(Module, String),
}

impl Crate {
    /// The crate of a `lib.rs` or `main.rs`.
    pub(crate) fn read(root: &Path) -> Self {
        let mut found = Self { modules: BTreeMap::new() };
        found.add(root, root.parent().unwrap(), Vec::new());
        found
    }

    /// Adds a file as a module whose children are in `folder`.
    fn add(&mut self, file: &Path, folder: &Path, module: Module) {
        let text = fs::read_to_string(file).unwrap();
        Reader { found: self, file, words: words(&text), at: 0 }.read(&module);
        let Ok(entries) = fs::read_dir(folder) else { return };
        let mut entries: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        entries.sort();
        for path in entries {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let child = [&module[..], std::slice::from_ref(&name)].concat();
            if name == "tests" {
                continue;
            }
            if path.join("mod.rs").is_file() {
                self.add(&path.join("mod.rs"), &path, child);
            } else if path.extension().is_some_and(|extension| extension == "rs")
                && !["lib", "main", "mod"].contains(&name.as_str())
            {
                self.add(&path, &path.with_extension(""), child);
            }
        }
    }

    /// References between files.
    pub(crate) fn links(&self) -> Links {
        let mut links = Links::new();
        let mut link = |from: &Path, found: Option<Found>| {
            if let Some(Found::Item(module, name)) = found {
                let to = &self.modules[&module].file;
                if to != from {
                    links.entry((from.to_owned(), to.clone())).or_default().insert(name);
                }
            }
        };
        for (module, contents) in &self.modules {
            let from = &contents.file;
            for (name, import) in &contents.imports {
                // A name that is only re-exported creates no link here.
                if !import.is_public || contents.used.contains(name) {
                    link(from, self.find(module, &import.path));
                }
            }
            for path in &contents.paths {
                link(from, self.find(module, path));
            }
            for glob in contents.globs.iter().filter(|glob| !glob.is_public) {
                let Some(Found::Module(of)) = self.find(module, &glob.path) else { continue };
                for name in &contents.used {
                    if !contents.items.contains(name) && !contents.imports.contains_key(name) {
                        link(from, self.item(&of, name, 0));
                    }
                }
            }
        }
        links
    }

    /// The target of a path in a module, if it is of this crate.
    fn find(&self, module: &[String], path: &[String]) -> Option<Found> {
        self.found(module, path, 0)
    }

    fn found(&self, module: &[String], path: &[String], depth: usize) -> Option<Found> {
        let mut at = module.to_vec();
        let mut rest = path;
        let mut is_own = false;
        while let [first, more @ ..] = rest {
            match first.as_str() {
                "crate" | "$crate" => at.clear(),
                "super" => drop(at.pop()),
                "self" => {}
                _ => break,
            }
            (rest, is_own) = (more, true);
        }
        let Some(first) = rest.first() else { return Some(Found::Module(at)) };
        // Otherwise the path is in another crate, or starts in this module.
        let is_child = |at: &Module, name: &String| {
            let child = [&at[..], std::slice::from_ref(name)].concat();
            self.modules.contains_key(&child).then_some(child)
        };
        if !is_own
            && is_child(&at, first).is_none()
            && !self.modules[&at].imports.contains_key(first)
        {
            return None;
        }
        while let [first, more @ ..] = rest {
            match is_child(&at, first) {
                Some(child)
                    if !more.is_empty() || !self.modules[&at].imports.contains_key(first) =>
                {
                    (at, rest) = (child, more);
                }
                _ => {
                    let found = self.item(&at, first, depth)?;
                    return self.inside(found, more, depth);
                }
            }
        }
        Some(Found::Module(at))
    }

    /// Resolves the rest of a path after a name.
    fn inside(&self, found: Found, rest: &[String], depth: usize) -> Option<Found> {
        match found {
            Found::Module(module) if !rest.is_empty() => {
                let path = [&["self".to_owned()][..], rest].concat();
                self.found(&module, &path, depth + 1)
            }
            found => Some(found),
        }
    }

    /// The target of a name in a module; `None` if the module neither defines nor imports it.
    fn item(&self, module: &[String], name: &str, depth: usize) -> Option<Found> {
        let contents = self.modules.get(module)?;
        if depth > 20 {
            return None;
        }
        if contents.items.contains(name) {
            return Some(Found::Item(module.to_vec(), name.to_owned()));
        }
        if let Some(import) = contents.imports.get(name) {
            return self.found(module, &import.path, depth + 1);
        }
        contents.globs.iter().find_map(|glob| match self.found(module, &glob.path, depth + 1)? {
            Found::Module(of) if of != module => self.item(&of, name, depth + 1),
            _ => None,
        })
    }
}

/// Parser of the words of a file.
struct Reader<'a> {
    found: &'a mut Crate,
    file: &'a Path,
    words: Vec<String>,
    at: usize,
}

impl Reader<'_> {
    fn word(&self, ahead: usize) -> &str {
        self.words.get(self.at + ahead).map_or("", String::as_str)
    }

    /// Reads a module up to its closing brace or the end of the file.
    fn read(&mut self, module: &[String]) {
        const DEFINE: [&str; 9] =
            ["fn", "struct", "enum", "union", "trait", "type", "const", "static", "mod"];
        let mut own = Contents { file: self.file.to_owned(), ..Contents::default() };
        let (mut braces, mut is_public) = (0, false);
        while self.at < self.words.len() {
            let word = self.word(0).to_owned();
            match word.as_str() {
                "#" if self.is_for_tests() => {
                    self.skip_item();
                    continue;
                }
                "{" => braces += 1,
                "}" if braces == 0 => break,
                "}" => braces -= 1,
                "pub" => {
                    is_public = true;
                    self.at += 1;
                    if self.word(0) == "(" {
                        while self.word(0) != ")" {
                            self.at += 1;
                        }
                        self.at += 1;
                    }
                    continue;
                }
                "use" => {
                    self.at += 1;
                    self.import(&mut own, Vec::new(), is_public);
                }
                "mod" if self.word(2) == "{" => {
                    let child = [module, &[self.word(1).to_owned()]].concat();
                    self.at += 3;
                    self.read(&child);
                }
                "macro_rules" => {
                    own.items.insert(self.word(2).to_owned());
                    // A macro with an attribute can be named from the root.
                    if !module.is_empty() {
                        let name = self.word(2).to_owned();
                        let path = [&["crate".to_owned()][..], module, std::slice::from_ref(&name)]
                            .concat();
                        let root = self.found.modules.entry(Vec::new()).or_default();
                        root.imports.entry(name).or_insert(Import { path, is_public: true });
                    }
                }
                word if DEFINE.contains(&word) && is_name(self.word(1)) && self.word(1) != "fn" => {
                    // Definitions inside braces belong to functions, types and implementations.
                    let defines = braces == 0 && word != "mod";
                    own.items.extend(defines.then(|| self.word(1).to_owned()));
                }
                word if is_name(word) => {
                    let mut path = vec![word.to_owned()];
                    while self.word(1) == "::" && is_name(self.word(2)) {
                        self.at += 2;
                        path.push(self.word(0).to_owned());
                    }
                    own.used.insert(path[0].clone());
                    if path.len() > 1 {
                        own.paths.insert(path);
                    }
                }
                _ => {}
            }
            is_public = false;
            self.at += 1;
        }
        let there = self.found.modules.remove(module).unwrap_or_default();
        own.imports.extend(there.imports);
        self.found.modules.insert(module.to_vec(), own);
    }

    /// Reads a tree of imports, up to its end.
    fn import(&mut self, own: &mut Contents, prefix: Vec<String>, is_public: bool) {
        let mut path = prefix.clone();
        loop {
            match self.word(0) {
                "::" => {}
                "{" => {
                    self.at += 1;
                    while self.word(0) != "}" {
                        self.import(own, path.clone(), is_public);
                        if self.word(0) == "," {
                            self.at += 1;
                        }
                    }
                    self.at += 1;
                    return;
                }
                "*" => {
                    own.globs.push(Import { path, is_public });
                    self.at += 1;
                    return;
                }
                "as" => {
                    let name = self.word(1).to_owned();
                    own.imports.insert(name, Import { path, is_public });
                    self.at += 2;
                    return;
                }
                "," | "}" | ";" | "" => {
                    if path.last().is_some_and(|last| last == "self") && path.len() > 1 {
                        path.pop();
                    }
                    if path.len() > prefix.len() || path == prefix && !path.is_empty() {
                        let name = path.last().unwrap().clone();
                        own.imports.insert(name, Import { path, is_public });
                    }
                    return;
                }
                word => path.push(word.to_owned()),
            }
            self.at += 1;
        }
    }

    /// Whether an attribute `#[cfg(test)]` starts here.
    fn is_for_tests(&self) -> bool {
        ["[", "cfg", "(", "test", ")", "]"]
            .iter()
            .enumerate()
            .all(|(k, word)| self.word(1 + k) == *word)
    }

    /// Skips an attribute and the item after it.
    fn skip_item(&mut self) {
        let mut depth = 0;
        while self.at < self.words.len() {
            match self.word(0) {
                "{" => depth += 1,
                "}" if depth == 1 => {
                    self.at += 1;
                    // The list of a `use` ends after its brace.
                    if self.word(0) == ";" {
                        self.at += 1;
                    }
                    return;
                }
                "}" => depth -= 1,
                ";" if depth == 0 => {
                    self.at += 1;
                    return;
                }
                _ => {}
            }
            self.at += 1;
        }
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|first: char| first.is_alphabetic() || first == '_' || first == '$')
}
