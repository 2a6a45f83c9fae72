//! Replays files that the example `fuzz_pictures` found: `tests/found/files` has one for each fixed fault, named after its reader.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

#[path = "found/readers.rs"]
mod readers;

#[test]
fn files_that_broke_a_reader_are_read_or_refused() {
    let files = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/found/files"));
    let (mut replayed, mut files) =
        (0, fs::read_dir(files).unwrap().map(Result::unwrap).peekable());
    let all = readers::all();
    assert!(files.peek().is_some());
    for file in files {
        let name = file.file_name().into_string().unwrap();
        let kind = all.iter().find(|kind| name.starts_with(&format!("{}_", kind.name)));
        let kind = kind.unwrap_or_else(|| panic!("{name} does not begin with a reader's name"));
        assert!(name.ends_with(kind.ending), "{name}");
        (kind.read)(&fs::read(file.path()).unwrap());
        replayed += 1;
    }
    assert!(replayed > 0);
}

#[test]
fn the_files_that_fuzzing_begins_with_are_sound_and_a_thousand_mutants_break_no_reader() {
    for kind in readers::all() {
        let seeds = (kind.seeds)();
        assert!(!seeds.is_empty(), "{}", kind.name);
        seeds.iter().for_each(|seed| (kind.read)(seed));
        for number in 0..1000 {
            (kind.read)(&softrast_fuzz::Mutator::new(&seeds, 1, kind.name, number).input());
        }
    }
}
