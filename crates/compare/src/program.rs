use std::{fs, process::ExitCode};

use anyhow::Context;
use clap::Parser;

use crate::{Args, results::markdown};

/// The whole `main` of the program.
pub fn main() -> ExitCode {
    match compare(&Args::parse(), &command()) {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Evaluates all cells, writes the tables after each, and says where. `command` is what the tables
/// name as what made them.
///
/// # Errors
///
/// If a cell cannot be evaluated or a file cannot be written.
pub fn compare(args: &Args, command: &str) -> anyhow::Result<String> {
    let cells = args.cells()?;
    let path = args.tables.clone().unwrap_or_else(|| args.out.join("results.md"));
    let mut measured = Vec::with_capacity(cells.len());
    for (k, cell) in cells.iter().enumerate() {
        if !args.quiet {
            let (task, variant, method) = (cell.task.name(), cell.variant, cell.method_name());
            eprintln!("cell {} of {}: {task}, {variant}, {method}", k + 1, cells.len());
        }
        measured.push(cell.evaluate(&args.out, args.backend.as_deref(), args.quiet)?);
        // After every cell: whoever stops a long comparison has a table of what is finished.
        fs::write(&path, markdown(&measured, command))
            .with_context(|| format!("cannot write the tables to {path:?}"))?;
    }
    Ok(format!("{} cells, tables in {}", measured.len(), path.display()))
}

/// The command line that the user gave.
fn command() -> String {
    let words = std::env::args().skip(1).map(|word| format!(" {word}"));
    format!("cargo run --release -p compare --{}", words.collect::<String>())
}
