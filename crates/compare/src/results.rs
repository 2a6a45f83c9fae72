//! The tables and charts as Markdown, and as one HTML page.

use std::fmt::Write;

use softrast_cli::Variant;
use softrast_lab::{
    machine,
    report::{Beside, Report},
};

use crate::{
    Measured, Record,
    charts::{Chart, Charts, by_variant},
    documents::block,
    groups, tables,
};

const HEAD: &str = include_str!("text/head.md");
const READING: &str = include_str!("text/reading.md");
const SECONDS: &str = include_str!("text/seconds.md");
const CROSSED: &str = include_str!("text/crossed.md");

/// The tables of the paper with our figures, as Markdown. The text names `command` as its origin; `pictures` is the charts' folder relative
/// to the file, if they are to be shown.
///
/// # Errors
///
/// If a table has no records.
pub(crate) fn markdown(
    measured: &[Measured],
    records: &[Record],
    charts: &Charts,
    command: &str,
    pictures: Option<&str>,
) -> anyhow::Result<String> {
    let table = |name: &str| block(records, name);
    let mut text = format!(
        "{HEAD}\n```\n{command}\n```\n\non {}.\n\n{READING}\n## Table 2: tasks\n\n{}\n## Table 3: errors\n",
        machine(),
        table("tasks")?
    );
    for (group, charts) in by_variant(measured).iter().zip(&charts.of_variants) {
        let cell = &group[0].cell;
        // Writing to a string does not fail.
        if cell.variant == Variant::Original {
            let _ = write!(text, "\n### {}\n\n{}\n", cell.task.title(), cell.task.paper().note);
        }
        let variant = cell.variant.name();
        let errors = table(&format!("errors {} {variant}", cell.task.name()))?;
        let _ = write!(text, "\n**{variant}**, seeds: {}\n\n{errors}", cell.runs);
        text.extend(charts.iter().map(|chart| shown(chart, pictures)));
    }
    let _ = write!(text, "\n## Table 5: seconds\n\n{SECONDS}\n{}", table("seconds")?);
    if records.iter().any(|record| !record.compared) {
        let crossed = table("crossed")?;
        let _ = write!(text, "\n## Table 6: cross evaluation\n\n{CROSSED}\n{crossed}");
    }
    if let Some(chart) = &charts.profile {
        text += "\n## Who is fast how often\n";
        text += &shown(chart, pictures);
    }
    Ok(text)
}

fn shown(chart: &Chart, pictures: Option<&str>) -> String {
    let Some(folder) = pictures else { return String::new() };
    format!("\n![{0}]({folder}/{0}.svg)\n\n{1}\n", chart.name, chart.caption)
}

/// The tables and charts as one HTML page, with the pictures of the first seed of every cell.
pub(crate) fn html(
    measured: &[Measured],
    records: &[Record],
    charts: &Charts,
    command: &str,
) -> anyhow::Result<String> {
    let mut report = Report::new("compare", "All methods on all tasks");
    report.paragraph(&format!("On {}.", machine()));
    READING.split("\n\n").for_each(|text| report.paragraph(&text.replace("**", "")));
    report.heading("Tasks");
    report.table(&tables::tasks(records));
    let errors = groups::by_variant(records);
    let groups = by_variant(measured);
    for ((group, charts), errors) in groups.iter().zip(&charts.of_variants).zip(&errors) {
        let cell = &group[0].cell;
        report.heading(&format!("{}, {}", cell.task.title(), cell.variant.name()));
        report.paragraph(cell.task.paper().note);
        report.paragraph(&format!("Seeds: {}", cell.runs));
        report.table(&tables::errors(errors));
        for chart in charts {
            report.chart(&chart.plot.svg()?, &chart.caption);
        }
        for one in group {
            if let Some(pictures) = &one.pictures {
                report.picture(&pictures.before_after, &format!("{}, first seed", one.cell.name));
            }
        }
    }
    report.heading("Seconds");
    report.paragraph(SECONDS);
    report.table(&tables::seconds(records));
    if let Some(table) = tables::named(records, "crossed")? {
        report.heading("Cross evaluation");
        report.paragraph(CROSSED);
        report.table(&table);
    }
    if let Some(chart) = &charts.profile {
        report.heading("Who is fast how often");
        report.chart(&chart.plot.svg()?, &chart.caption);
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
        for text in [HEAD, READING, SECONDS, CROSSED] {
            assert!(
                document.contains(text.trim()),
                "docs/results.md has another text than: {text}"
            );
        }
    }
}
