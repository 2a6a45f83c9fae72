//! The tables and charts as Markdown, and as one HTML page.

use std::fmt::Write;

use softrast_lab::{
    machine,
    report::{Beside, Report},
};

use crate::{Measured, Record, charts::Chart, documents::block, groups::by_variant, tables};

const HEAD: &str = include_str!("text/head.md");
const READING: &str = include_str!("text/reading.md");
const SECONDS: &str = include_str!("text/seconds.md");
const PAPER: &str = include_str!("text/paper.md");
const CROSSED: &str = include_str!("text/crossed.md");
const CHANGED: &str = "Resolution, tolerance, backend";
const VARIATIONS: &str = include_str!("text/variations.md");

/// The tables of the paper with our figures, as Markdown. The text names `command` as its origin; `pictures` is the charts' folder relative
/// to the file, if they are to be shown.
///
/// # Errors
///
/// If a table has no records.
pub(crate) fn markdown(
    records: &[Record],
    charts: &[Chart],
    command: &str,
    pictures: Option<&str>,
) -> anyhow::Result<String> {
    let table = |name: &str| block(records, name);
    let mut text = format!(
        "{HEAD}\n```\n{command}\n```\n\non {}.\n\n{READING}\n## Table 2: tasks\n\n{}\n## Table 3: errors\n",
        machine(),
        table("tasks")?
    );
    for (group, chart) in by_variant(records).iter().zip(charts) {
        let first = group[0];
        let (task, variant) = (first.task(), first.variant());
        // Writing to a string does not fail.
        if first.original {
            let _ = write!(text, "\n### {}\n\n{}\n", task.title, task.paper.note);
        }
        let errors = table(&format!("errors {} {variant}", task.name))?;
        let _ = write!(text, "\n**{variant}**, seeds: {}\n\n{errors}", first.returned.len());
        text += &shown(chart, pictures);
    }
    let _ = write!(text, "\n## Table 3 in the paper's unit\n\n{PAPER}\n{}", table("paper")?);
    let _ = write!(text, "\n## Table 5: seconds\n\n{SECONDS}\n{}", table("seconds")?);
    if records.iter().any(|record| record.varied) {
        let _ = write!(text, "\n## {CHANGED}\n\n{VARIATIONS}\n{}", table("variations")?);
    }
    if records.iter().any(|record| !record.compared) {
        let crossed = table("crossed")?;
        let _ = write!(text, "\n## Table 6: cross evaluation\n\n{CROSSED}\n{crossed}");
    }
    Ok(text)
}

fn shown(chart: &Chart, pictures: Option<&str>) -> String {
    let Some(folder) = pictures else { return String::new() };
    format!("\n![{}]({folder}/{}.svg)\n", chart.caption, chart.name)
}

/// The tables and charts as one HTML page, with the pictures of the first seed of every cell.
pub(crate) fn html(
    measured: &[Measured],
    records: &[Record],
    charts: &[Chart],
    command: &str,
) -> anyhow::Result<String> {
    let mut report = Report::new("compare", "All methods on all tasks");
    report.paragraph(&format!("On {}.", machine()));
    READING.split("\n\n").for_each(|text| report.paragraph(&text.replace("**", "")));
    report.heading("Tasks");
    report.table(&tables::tasks(records));
    for (group, chart) in by_variant(records).iter().zip(charts) {
        let first = group[0];
        report.heading(&format!("{}, {}", first.task().title, first.variant()));
        report.paragraph(first.task().paper.note);
        report.paragraph(&format!("Seeds: {}", first.returned.len()));
        report.table(&tables::errors(group));
        report.chart(&chart.plot.svg()?, &chart.caption);
        let here = |one: &&Measured| {
            one.cell.task.name == first.task && one.cell.variant.name() == first.variant()
        };
        for one in measured.iter().filter(here) {
            if let Some(pictures) = &one.pictures {
                report.picture(&pictures.before_after, &format!("{}, first seed", one.cell.name));
            }
        }
    }
    report.heading("Seconds");
    report.paragraph(SECONDS);
    report.table(&tables::seconds(records));
    if let Some(table) = tables::variations(records) {
        report.heading(CHANGED);
        report.paragraph(VARIATIONS);
        report.table(&table);
    }
    if let Some(table) = tables::named(records, "crossed")? {
        report.heading("Cross evaluation");
        report.paragraph(CROSSED);
        report.table(&table);
    }
    let beside = [
        Beside::new("runs.jsonl", "every run"),
        Beside::new("cells.csv", "the numbers behind the tables"),
    ];
    Ok(report.finish(command, &beside))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_has_the_texts_that_another_call_would_print() {
        let document = include_str!("../../../docs/results.md");
        for text in [HEAD, READING, PAPER, SECONDS, VARIATIONS, CROSSED] {
            assert!(
                document.contains(text.trim()),
                "docs/results.md has another text than: {text}"
            );
        }
    }
}
