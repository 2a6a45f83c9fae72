//! Passes mutated files to every reader of meshes: `cargo run --release -p softrast-mesh --example fuzz_meshes -- --inputs 200000`.
//!
//! The checks of the results are those of `tests/found.rs`, which replays the files found here.

use std::process::ExitCode;

use softrast_fuzz::{Allocator, Reader};

#[path = "../tests/found/readers.rs"]
mod readers;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn main() -> ExitCode {
    let folder = tempfile::Builder::new().prefix("softrast-fuzz").tempdir();
    let folder = match folder {
        Ok(folder) => folder,
        Err(reason) => {
            eprintln!("error: no folder for temporary files: {reason}");
            return ExitCode::from(2);
        }
    };
    let folder = folder.path();
    let readers = readers::all().into_iter().map(|kind| {
        Reader::new(kind.name, kind.ending, (kind.seeds)(), move |bytes| (kind.read)(bytes, folder))
    });
    softrast_fuzz::main(readers.collect())
}
