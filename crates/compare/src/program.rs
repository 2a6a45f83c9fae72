use std::{
    fs,
    io::{self, Write},
    path::Path,
    process::ExitCode,
};

use anyhow::Context;
use clap::Parser;
use tempfile::NamedTempFile;

use crate::{
    Args, Measured,
    charts::{of_variant, profile},
    records,
    results::{by_variant, html, markdown},
};

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

/// Evaluates all cells, writes tables, report and charts after each, and says where. `command` is what
/// they name as what made them.
///
/// # Errors
///
/// If a cell cannot be evaluated or a file cannot be written.
pub fn compare(args: &Args, command: &str) -> anyhow::Result<String> {
    let cells = args.cells()?;
    let mut measured = Vec::with_capacity(cells.len());
    for (k, cell) in cells.iter().enumerate() {
        if !args.quiet {
            let (task, variant, method) = (cell.task.name(), cell.variant, cell.method_name());
            eprintln!("cell {} of {}: {task}, {variant}, {method}", k + 1, cells.len());
        }
        measured.push(cell.evaluate(&args.out, args.backend.as_deref(), args.quiet)?);
        // After every cell: whoever stops a long comparison has tables of what is finished.
        write(args, &measured, command)?;
    }
    let path = args.tables.clone().unwrap_or_else(|| args.out.join("results.md"));
    let report = args.out.join("report.html");
    Ok(format!(
        "{} cells, tables in {}, charts in {}",
        measured.len(),
        path.display(),
        report.display()
    ))
}

/// Tables, report, charts and numbers; each file is the old one or the new one, whole.
fn write(args: &Args, measured: &[Measured], command: &str) -> anyhow::Result<()> {
    let tables = args.tables.clone().unwrap_or_else(|| args.out.join("results.md"));
    let charts = match &args.tables {
        Some(tables) => tables.with_extension(""),
        None => args.out.join("charts"),
    };
    fs::create_dir_all(&charts).with_context(|| format!("cannot make the folder {charts:?}"))?;
    let groups = by_variant(measured);
    let drawn = groups.iter().flat_map(|group| of_variant(group)).chain(profile(&groups));
    for chart in drawn {
        replace(&charts.join(format!("{}.svg", chart.name)), &chart.plot.svg()?)?;
        replace(&charts.join(format!("{}.csv", chart.name)), &chart.plot.csv())?;
    }
    let shown = charts.file_name().and_then(|name| name.to_str());
    replace(&tables, &markdown(measured, command, shown))?;
    replace(&args.out.join("cells.csv"), &records::csv(measured))?;
    replace(&args.out.join("cells.json"), &records::json(measured))?;
    replace(&args.out.join("report.html"), &html(measured, command, &args.out)?)
}

/// Writes a file under another name first.
fn replace(path: &Path, text: &str) -> anyhow::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let written = || -> io::Result<()> {
        let mut file = NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))?;
        file.write_all(text.as_bytes())?;
        file.persist(path)?;
        Ok(())
    };
    written().with_context(|| format!("cannot write {path:?}"))
}

/// The command line that the user gave.
fn command() -> String {
    let words = std::env::args().skip(1).map(|word| match word.contains(' ') {
        true => format!(" \"{word}\""),
        false => format!(" {word}"),
    });
    format!("cargo run --release -p compare --{}", words.collect::<String>())
}
