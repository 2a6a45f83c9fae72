//! Table 6 of the paper: what was learned on one task, used on another.

use softrast_cli::SoftnessChoice;
use softrast_lab::report::Table;

use crate::{
    Measured, Purpose, TASKS,
    tables::{by_variant, with_interval},
};

/// What was learned on each task, on all of them; the lowest of a column in bold. None where nothing is crossed.
pub(crate) fn crossed(measured: &[Measured]) -> Option<Table> {
    let mut rows: Vec<(String, &'static str)> = Vec::new();
    for one in measured.iter().filter(|one| matches!(one.cell.purpose, Purpose::Crossed(_))) {
        rows.extend(learned_on(one).filter(|row| !rows.contains(row)));
    }
    rows.sort_by_key(|(kind, task)| (kind.clone(), TASKS.iter().position(|t| t.name() == *task)));
    let groups = by_variant(measured);
    let columns = groups.iter().map(|group| {
        let (cell, hard) = (&group[0].cell, group[0].title(group[0].hard_place()));
        format!("{} {}, {hard}", cell.task.title(), cell.variant.name())
    });
    let mut table = Table::new(["learned on".to_owned()].into_iter().chain(columns));
    let of = |row: &(String, &'static str), group: &[&Measured]| {
        let here = |one: &&Measured| {
            let (cell, other) = (&one.cell, &group[0].cell);
            cell.task.name() == other.task.name() && cell.variant == other.variant
        };
        measured
            .iter()
            .filter(here)
            .find(|one| learned_on(one).as_ref() == Some(row))
            .map(Measured::hard)
    };
    let errors: Vec<Vec<_>> =
        rows.iter().map(|row| groups.iter().map(|group| of(row, group)).collect()).collect();
    for ((kind, task), row) in rows.iter().zip(&errors) {
        let title = TASKS.iter().find(|t| t.name() == *task).map_or(*task, |task| task.title());
        let called = if kind.is_empty() { title.to_owned() } else { format!("{title}, {kind}") };
        let cells = row.iter().enumerate().map(|(k, error)| {
            let column = errors.iter().filter_map(|row| row[k].as_ref()).map(|error| error.mean);
            let lowest = column.fold(f64::INFINITY, f64::min);
            error.as_ref().map_or(String::new(), |error| match error.mean == lowest {
                true => format!("**{}**", with_interval(error)),
                false => with_interval(error),
            })
        });
        table.push([called].into_iter().chain(cells));
    }
    (!rows.is_empty()).then_some(table)
}

/// The kind of what comes with the programs, and the task that it was learned on.
fn learned_on(one: &Measured) -> Option<(String, &'static str)> {
    let Some(SoftnessChoice::Learned(kind)) = &one.cell.method.softness else { return None };
    let kind = kind.clone().unwrap_or_default();
    match one.cell.purpose {
        Purpose::Crossed(from) => {
            let own = kind.strip_prefix(from).map(|kind| kind.trim_start_matches('-').to_owned());
            Some((own.unwrap_or(kind), from))
        }
        Purpose::Compared => Some((kind, one.cell.task.name())),
        Purpose::Varied(_) => None,
    }
}
