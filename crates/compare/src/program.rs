use std::{ffi::OsString, fs, io::Write, process::ExitCode};

use anyhow::{Context, ensure};
use clap::CommandFactory;
use serde_json::json;
use softrast_lab::{
    Error, Failure, Progress, Runner, Store, Work,
    program::{Output, parse, repeated, run_main},
    write_atomically,
};

use crate::{
    Args, Cell, Measured, Record,
    charts::{Charts, by_variant},
    documents::recomputed,
    records,
    results::{html, markdown},
};

/// The whole `main` of the program.
pub fn main() -> ExitCode {
    run_main(execute)
}

fn execute(words: Vec<OsString>, stdout: &mut dyn Write) -> Result<(), Failure> {
    let Some(args) = parse::<Args>(Args::command(), &words, stdout)? else { return Ok(()) };
    let again = repeated("compare", &words);
    let output =
        if args.recompute.is_empty() { compare(&args, &again)? } else { recompute(&args)? };
    output.print(args.json, &again, stdout)
}

/// Makes the tables of documents again of the records that they keep.
///
/// # Errors
///
/// If a document cannot be made again or written, or had another table; it is written then.
fn recompute(args: &Args) -> anyhow::Result<Output> {
    let mut others = Vec::new();
    for document in &args.recompute {
        let [old, new] = recomputed(document)?;
        if old != new {
            write_atomically(document, new.as_bytes())
                .with_context(|| format!("cannot write {document:?}"))?;
            others.push(document.display().to_string());
        }
    }
    ensure!(
        others.is_empty(),
        "other tables than its records give had {}: written anew",
        others.join(", ")
    );
    let text =
        vec![format!("{} documents have the tables that their records give", args.recompute.len())];
    Ok(Output { json: json!({ "documents": args.recompute }), text, ..Output::default() })
}

/// Evaluates all cells, writes tables, report and charts after each, and says where. `command` is what they name as what made them.
///
/// # Errors
///
/// If a cell cannot be evaluated or a file cannot be written.
pub fn compare(args: &Args, command: &str) -> anyhow::Result<Output> {
    let cells = args.cells()?;
    fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make the folder {:?}", args.out))?;
    let runs = args.out.join("runs.jsonl");
    let progress = Progress::of_program(args.quiet);
    if let Some(shard) = args.shard {
        return part(args, &cells, Runner { progress, store: Store::of_shard(&runs, shard)? });
    }
    let (store, note) = Store::open(&runs)?;
    note.filter(|_| runs.exists()).iter().for_each(|note| eprintln!("{note}"));
    let mut runner = Runner { progress, store };
    let mut measured = Vec::with_capacity(cells.len());
    for (k, cell) in cells.iter().enumerate() {
        let (task, variant) = (cell.task.name(), cell.variant.name());
        if !args.quiet {
            eprintln!("cell {} of {}: {task}, {variant}, {}", k + 1, cells.len(), cell.name);
        }
        let one = Measured::of(cell, &mut runner, args.backend.as_deref());
        runner.progress = Progress::of_program(args.quiet);
        measured.push(one.with_context(|| format!("{task} {variant} with {}", cell.name))?);
        // After every cell: whoever stops a long comparison has tables of what is finished.
        write(args, &measured, command)?;
    }
    let tables = args.tables.clone().unwrap_or_else(|| args.out.join("results.md"));
    let report = args.out.join("report.html");
    let text = format!(
        "{} cells, tables in {}, charts in {}",
        measured.len(),
        tables.display(),
        report.display()
    );
    let records: Vec<Record> = measured.iter().map(Record::of).collect();
    let json = json!({ "cells": records, "tables": tables, "report": report });
    Ok(Output { json, text: vec![text], ..Output::default() })
}

/// Makes the runs that are a shard's; no table is written.
fn part(args: &Args, cells: &[Cell], mut runner: Runner) -> anyhow::Result<Output> {
    let backend = args.backend.as_deref();
    let entries = cells.iter().map(|cell| Ok((cell.entry(backend)?, cell.seeds())));
    let entries: Vec<_> = entries.collect::<anyhow::Result<_>>()?;
    let job: Vec<Work<'_>> = entries
        .iter()
        .map(|(entry, seeds)| Work { experiment: entry.experiment.as_ref(), seeds, pictures: true })
        .collect();
    let part = runner.part(&job)?;
    let text = vec![
        format!("{} runs of this shard are finished", part.finished),
        "then: the same command without --shard, for the tables of all shards".to_owned(),
    ];
    let json = json!({ "finished": part.finished, "out": args.out });
    if part.finished < part.asked {
        let kept = part.of("runs of this shard");
        let stopped = anyhow::Error::from(Error::Interrupted);
        return Err(stopped.context(format!("{kept}, and the same command goes on from them")));
    }
    Ok(Output { json, text, ..Output::default() })
}

/// Tables, report, charts and numbers; each file is the old one or the new one, whole.
fn write(args: &Args, measured: &[Measured], command: &str) -> anyhow::Result<()> {
    let replace = |path: &std::path::Path, text: &str| {
        write_atomically(path, text.as_bytes()).with_context(|| format!("cannot write {path:?}"))
    };
    let tables = args.tables.clone().unwrap_or_else(|| args.out.join("results.md"));
    let folder = tables.with_extension("");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder {folder:?}"))?;
    let charts = Charts::new(&by_variant(measured));
    for chart in charts.iter() {
        replace(&folder.join(format!("{}.svg", chart.name)), &chart.plot.svg()?)?;
        replace(&folder.join(format!("{}.csv", chart.name)), &chart.plot.csv())?;
    }
    let shown = folder.file_name().and_then(|name| name.to_str());
    let records: Vec<Record> = measured.iter().map(Record::of).collect();
    replace(&folder.join("cells.jsonl"), &records::text(&records)?)?;
    replace(&tables, &markdown(measured, &records, &charts, command, shown)?)?;
    replace(&args.out.join("cells.csv"), &records::csv(&records))?;
    replace(&args.out.join("report.html"), &html(measured, &records, &charts, command)?)
}
