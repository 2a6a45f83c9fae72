//! Replays files that the example `fuzz_meshes` found: `tests/found/files` has one for each fixed fault, named after its reader.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

#[path = "found/readers.rs"]
mod readers;

#[test]
fn files_that_broke_a_reader_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let files = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/found/files"));
    let mut replayed = 0;
    for kind in readers::all() {
        for file in fs::read_dir(files).unwrap().map(|entry| entry.unwrap().path()) {
            let stem = file.file_stem().unwrap().to_str().unwrap();
            if stem.strip_prefix(kind.name).is_some_and(|rest| rest.starts_with('_')) {
                assert_eq!(file.extension().unwrap(), kind.ending);
                (kind.read)(&fs::read(&file).unwrap(), folder.path());
                replayed += 1;
            }
        }
    }
    assert_eq!(replayed, fs::read_dir(files).unwrap().count(), "names begin with a reader's");
}

#[test]
fn the_files_that_fuzzing_begins_with_are_sound() {
    let folder = tempfile::tempdir().unwrap();
    for kind in readers::all() {
        for seed in (kind.seeds)() {
            (kind.read)(&seed, folder.path());
        }
    }
}

#[test]
fn a_thousand_mutated_files_break_no_reader() {
    let folder = tempfile::tempdir().unwrap();
    for kind in readers::all() {
        let seeds = (kind.seeds)();
        for number in 0..1000 {
            let input = softrast_fuzz::Mutator::new(&seeds, 1, kind.name, number).input();
            (kind.read)(&input, folder.path());
        }
    }
}
