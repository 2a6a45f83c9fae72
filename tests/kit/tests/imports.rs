//! No cyclic imports between files, and burn is imported in one place.
//!
//! A file imports another if it refers to an item of the other, by `use` or by a path. A re-export is resolved to the file that defines the
//! item, so a module that only re-exports creates no dependency. Test modules are excluded, and so are types that are never named.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod repository;
mod rust;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use repository::{files, root, shown};
use rust::{Crate, Links};

#[test]
fn no_file_imports_another_in_a_circle() {
    let mut circles = Vec::new();
    let mut links = 0;
    for source in sources() {
        let found = Crate::read(&source).links();
        links += found.len();
        circles.extend(circles_of(&found));
    }
    assert!(links > 500, "the links of this repository are found, not {links} alone");
    assert!(circles.is_empty(), "{} circles of imports:\n{}", circles.len(), circles.join("\n"));
}

/// Another release of burn, or other tensors, then only require a change of `crates/tensor`.
#[test]
fn only_the_tensor_crate_depends_on_burn() {
    let manifests = files(root(), "toml").into_iter().filter(|path| path.ends_with("Cargo.toml"));
    let depend: Vec<String> = manifests
        .filter(|path| {
            let text = fs::read_to_string(path).unwrap();
            path.parent() != Some(root()) && text.lines().any(|line| line.starts_with("burn"))
        })
        .map(|path| shown(&path))
        .collect();
    // The other one is for another release of burn.
    assert_eq!(depend, ["bindings/burn/Cargo.toml", "crates/tensor/Cargo.toml"]);
}

/// The root folders of crates: those with a `lib.rs`, or with only a `main.rs`.
fn sources() -> Vec<PathBuf> {
    let roots = files(root(), "rs").into_iter().filter(|path| {
        let name = path.file_name().unwrap();
        name == "lib.rs" || name == "main.rs" && !path.with_file_name("lib.rs").exists()
    });
    roots.collect()
}

/// One line per set of files that import each other, with the names that link them.
fn circles_of(links: &Links) -> Vec<String> {
    let mut next: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
    for (from, to) in links.keys() {
        next.entry(from).or_default().insert(to);
    }
    let reach: BTreeMap<&Path, BTreeSet<&Path>> =
        next.keys().map(|&file| (file, reached(file, &next))).collect();
    let mutual =
        |a: &Path, b: &Path| reach[a].contains(b) && reach.get(b).is_some_and(|r| r.contains(a));
    let mut told = BTreeSet::new();
    let mut circles = Vec::new();
    for &file in next.keys().filter(|&&file| mutual(file, file)) {
        if !told.insert(file) {
            continue;
        }
        told.extend(reach[file].iter().filter(|other| mutual(file, other)));
        let inside = |path: &Path| path == file || mutual(file, path);
        let ties = links.iter().filter(|((from, to), _)| inside(from) && inside(to));
        let ties = ties.map(|((from, to), names)| {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            format!("  {} imports {} from {}", shown(from), names.join(", "), shown(to))
        });
        circles.push(ties.collect::<Vec<_>>().join("\n"));
    }
    circles
}

/// All files that a file imports, directly or indirectly.
fn reached<'a>(
    file: &'a Path,
    next: &BTreeMap<&'a Path, BTreeSet<&'a Path>>,
) -> BTreeSet<&'a Path> {
    let (mut found, mut open) = (BTreeSet::new(), vec![file]);
    while let Some(file) = open.pop() {
        for &other in next.get(file).into_iter().flatten() {
            if found.insert(other) {
                open.push(other);
            }
        }
    }
    found
}

/// Creates a crate of these files in a new folder; returns its cycles.
fn circles_in(written: &[(&str, &str)]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in written {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    circles_of(&Crate::read(&folder.path().join("lib.rs")).links())
}

#[test]
fn two_files_that_use_each_other_are_a_circle_however_they_are_named() {
    let lib = ("lib.rs", "mod a;\nmod b;\npub use a::{A, make};\npub use b::*;\n");
    let b = ("b.rs", "use crate::A;\npub struct B(pub A);\n");
    for a in [
        "use crate::b::B;\npub struct A;",
        "use super::{b::{B as Other}};\npub struct A;",
        "pub struct A;\npub fn make() { let _ = crate::b::B(A); }",
        "use crate::B;\npub struct A;",
        "use crate::b;\npub struct A;\nfn f() -> b::B { todo!() }",
        "use crate::*;\npub struct A;\nfn f(b: B) {}",
    ] {
        let found = circles_in(&[lib, b, ("a.rs", a)]);
        assert_eq!(found.len(), 1, "{a}");
        assert!(found[0].contains("imports B from"), "{}", found[0]);
    }
}

#[test]
fn a_parent_that_names_what_its_child_defines_is_a_circle_if_the_child_uses_the_parent() {
    let child = ("m/child.rs", "use super::Parent;\npub struct Child(Parent);\n");
    let of =
        |parent: &str| circles_in(&[("lib.rs", "mod m;\n"), ("m/mod.rs", parent), child]).len();
    assert_eq!(of("mod child;\nuse child::Child;\npub struct Parent;\nfn f(c: Child) {}\n"), 1);
    assert_eq!(of("mod child;\npub struct Parent;\nfn f(c: child::Child) {}\n"), 1);
    assert_eq!(of("mod child;\npub use child::Child;\npub struct Parent;\n"), 0);
}

#[test]
fn re_exports_tests_comments_and_text_make_no_circle() {
    let lib = ("lib.rs", "mod a;\nmod b;\npub use a::A;\npub use b::B;\n");
    let b = ("b.rs", "use crate::A;\npub struct B(pub A);\n");
    for a in [
        "/// See [`crate::B`].\npub struct A; // crate::b::B",
        "pub struct A;\nconst TEXT: &str = \"crate::b::B\";\nconst RAW: &str = r#\"use crate::B;\"#;",
        "pub struct A;\n#[cfg(test)]\nmod tests {\n    use crate::B;\n}\n",
        "pub struct A;\n#[cfg(test)]\nuse crate::B;\n",
        "pub struct A<'a>(&'a u8);\nconst QUOTE: char = '\"';\nconst ALSO: char = '\\'';\n",
    ] {
        assert_eq!(circles_in(&[lib, b, ("a.rs", a)]), Vec::<String>::new(), "{a}");
    }
}
