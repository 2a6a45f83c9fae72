use std::{
    ffi::OsString,
    fs,
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context, ensure};
use clap::CommandFactory;
use serde_json::json;
use softrast_lab::{
    Error, Failure, Inputs, OutputFolder, Progress, Runner, Store, Work,
    program::{Output, parse, repeated, run_main, say},
    shown, write_atomically,
};

use crate::{
    Args, Cell, Measured, Record,
    charts::{Chart, charts},
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
    let inputs = Inputs::of_words(&words, &["--out", "--tables"]);
    let output = match args.recompute.is_empty() {
        true => compare(&args, &again, &inputs)?,
        false => recompute(&args)?,
    };
    output.print(args.json, &again, stdout)
}

/// Rebuilds the tables of documents and the charts beside them from their stored records.
///
/// # Errors
///
/// If a document cannot be rebuilt or written, or if it had another table; then it is updated nevertheless.
fn recompute(args: &Args) -> anyhow::Result<Output> {
    let mut others = Vec::new();
    for document in &args.recompute {
        let folder = document.with_extension("");
        if let Ok(text) = fs::read_to_string(folder.join(RECORDS)) {
            for Chart { name, plot, .. } in charts(&records::read(&text)?) {
                let file = folder.join(format!("{name}.svg"));
                write_atomically(&file, plot.svg()?.as_bytes())
                    .with_context(|| format!("cannot write {file:?}"))?;
            }
        }
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
    let documents: Vec<String> = args.recompute.iter().map(|path| shown(path)).collect();
    let text =
        vec![format!("{} documents have the tables that their records give", args.recompute.len())];
    Ok(Output { json: json!({ "documents": documents }), text, ..Output::default() })
}

/// Evaluates all cells, writes tables, report and charts after each, and returns where they are. The files name `command` as their origin;
/// `inputs` are the files that it reads.
///
/// # Errors
///
/// If a cell cannot be evaluated or a file cannot be written.
pub fn compare(args: &Args, command: &str, inputs: &Inputs) -> anyhow::Result<Output> {
    let cells = args.cells()?;
    let mut folders = Folders::open(args, inputs)?;
    let goes_on = folders.out.file(RUNS).exists();
    let (store, note) = Store::of_command(&mut folders.out, RUNS, args.shard, true)?;
    let mut runner = Runner { progress: Progress::of_program(args.quiet), store };
    if args.shard.is_some() {
        return part(args, &cells, runner);
    }
    note.filter(|_| goes_on).iter().for_each(|note| say(note));
    let mut measured = Vec::with_capacity(cells.len());
    for (k, cell) in cells.iter().enumerate() {
        let (task, variant) = (cell.task.name, cell.variant.name());
        if !args.quiet {
            let place = format!("cell {} of {}", k + 1, cells.len());
            say(&format!("{place}: {task}, {variant}, {}", cell.name));
        }
        let one = Measured::of(cell, &mut runner, args.backend.as_deref());
        runner.progress = Progress::of_program(args.quiet);
        measured.push(one.with_context(|| format!("{task} {variant} with {}", cell.name))?);
        // After every cell, so that an interrupted comparison has tables of the finished cells.
        folders.write(&measured, command)?;
    }
    let [tables, report] = [tables(args), args.out.join(PAGE)].map(|path| shown(&path));
    let text = format!("{} cells, tables in {tables}, charts in {report}", measured.len());
    let records: Vec<Record> = measured.iter().map(Record::of).collect();
    let json = json!({ "cells": records, "tables": tables, "report": report });
    Ok(Output { json, text: vec![text], ..Output::default() })
}

/// Executes the runs of a shard; no table is written.
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
    let json = json!({ "finished": part.finished, "out": shown(&args.out) });
    if part.finished < part.asked {
        let kept = part.of("runs of this shard");
        let stopped = anyhow::Error::from(Error::Interrupted);
        return Err(stopped.context(format!("{kept}, and the same command goes on from them")));
    }
    Ok(Output { json, text, ..Output::default() })
}

const PAGE: &str = "report.html";
const CELLS: &str = "cells.csv";
const RECORDS: &str = "cells.jsonl";
const RUNS: &str = "runs.jsonl";

/// The document with the tables.
fn tables(args: &Args) -> PathBuf {
    args.tables.clone().unwrap_or_else(|| args.out.join("results.md"))
}

/// Output folders of the page, of the document with the tables, and of the charts next to it.
struct Folders {
    /// The first field, so that it is removed first if nothing is written.
    charts: OutputFolder,
    /// Name of the charts' folder, relative to the document.
    shown: String,
    tables: OutputFolder,
    document: String,
    out: OutputFolder,
}

impl Folders {
    fn open(args: &Args, inputs: &Inputs) -> anyhow::Result<Self> {
        let tables = tables(args);
        let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
        let parent = tables.parent().filter(|folder| !folder.as_os_str().is_empty());
        let charts = tables.with_extension("");
        let named = name(&tables).zip(name(&charts)).filter(|_| charts != tables);
        let (document, shown) = named.ok_or_else(|| {
            let message = format!("--tables {}: expected a name such as a.md", tables.display());
            Error::usage(message)
        })?;
        // Each has separate results, even where two are one folder.
        let open = |path: &Path, command| OutputFolder::open(path, command, inputs);
        let folders = Self {
            out: open(&args.out, "compare")?,
            tables: open(parent.unwrap_or(Path::new(".")), "compare --tables")?,
            charts: open(&charts, "compare, charts")?,
            document,
            shown,
        };
        folders.out.claim([PAGE, CELLS])?;
        folders.tables.claim([&folders.document])?;
        folders.charts.claim([RECORDS])?;
        Ok(folders)
    }

    /// Writes tables, report, charts and numbers.
    fn write(&mut self, measured: &[Measured], command: &str) -> anyhow::Result<()> {
        let records: Vec<Record> = measured.iter().map(Record::of).collect();
        let charts = charts(&records);
        for chart in &charts {
            self.charts.stage(&format!("{}.svg", chart.name), chart.plot.svg()?.as_bytes())?;
            self.charts.stage(&format!("{}.csv", chart.name), chart.plot.csv().as_bytes())?;
        }
        self.charts.stage(RECORDS, records::text(&records)?.as_bytes())?;
        let tables = markdown(&records, &charts, command, Some(&self.shown))?;
        self.tables.stage(&self.document, tables.as_bytes())?;
        self.out.stage(CELLS, records::csv(&records).as_bytes())?;
        self.out.stage(PAGE, html(measured, &records, &charts, command)?.as_bytes())?;
        self.charts.commit()?;
        // Documents with other names belong to other comparisons.
        self.tables.commit_beside(|_| true)?;
        Ok(self.out.commit()?)
    }
}
