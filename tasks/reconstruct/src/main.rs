//! Single-view 3D reconstruction: a network that learns shapes from their silhouettes.

use std::{io, process::ExitCode};

fn main() -> ExitCode {
    let words = std::env::args_os();
    match reconstruct::execute(words, &mut io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::from(failure.code)
        }
    }
}
