//! Gives mutated files to the readers of pictures, cameras and softnesses:
//! `cargo run --release -p softrast-inverse --example fuzz_pictures -- --inputs 200000`.
//!
//! The checks of what is read are those of `tests/found.rs`, which replays what was found here.

use std::process::ExitCode;

use softrast_fuzz::{Allocator, Reader};

#[path = "../tests/found/readers.rs"]
mod readers;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn main() -> ExitCode {
    let readers = readers::all().into_iter().map(|kind| {
        Reader::new(kind.name, kind.ending, (kind.seeds)(), move |bytes| (kind.read)(bytes))
    });
    softrast_fuzz::main(readers.collect())
}
