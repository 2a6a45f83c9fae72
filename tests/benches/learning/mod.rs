//! What the benchmarks of learning share: tasks from a command line, plans, and their page.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context;
use clap::{Args, Parser};
use softrast_runner::{Input, Judged, Order, Plan, Referee, Settings, Task, Variant};

#[derive(Parser)]
struct Line<A: Args> {
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    args: A,
}

/// A task as its flags make it.
pub(crate) fn task<T: Task>(flags: &str) -> anyhow::Result<T> {
    let words = ["task"].into_iter().chain(flags.split_whitespace());
    let Line { settings, args } = Line::<T::Args>::try_parse_from(words)?;
    T::prepare(&settings, &args)
}

/// What `learn` does by default, in this order and judged like this.
pub(crate) fn plan(order: Order, referee: Referee) -> Plan {
    Plan {
        variant: Variant::Original,
        order,
        outer: 1,
        batch: 1,
        outer_rate: 0.03,
        learn_rate: false,
        seed: 1_000_000,
        validation_seed: 2_000_000,
        validation_runs: 1,
        patience: None,
        referee,
        judged: Judged::End,
        knots: 3,
        input: Input::Ndc,
        floor_px: 0.03,
    }
}

/// A file among the documents.
pub(crate) fn docs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name)
}

/// Puts `text` between the two marks that a page among the documents has for a benchmark.
///
/// # Errors
///
/// If the page is not there or has no such marks.
pub(crate) fn write(page: &str, benchmark: &str, text: &str) -> anyhow::Result<()> {
    let page = docs(page);
    let start = format!("<!-- what follows is written by the benchmark {benchmark} -->\n");
    let end = format!("<!-- end of what the benchmark {benchmark} writes -->");
    let old = fs::read_to_string(&page)?;
    let (before, rest) = old.split_once(&start).context("the page has no mark for the start")?;
    let (_, after) = rest.split_once(&end).context("the page has no mark for the end")?;
    Ok(fs::write(page, format!("{before}{start}{text}{end}{after}"))?)
}
