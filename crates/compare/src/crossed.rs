//! Table 6 of the paper: what was learned on one task, used on another.

use softrast_cli::{SoftnessChoice, is_preset_learned};
use softrast_lab::{mean, report::Table};

use crate::{
    Cell, Purpose, Record, TASKS,
    tables::{by_variant, with_interval},
};

/// What was learned on each task, on all of them; the lowest of a column in bold. None where nothing is crossed.
pub(crate) fn crossed(records: &[Record]) -> Option<Table> {
    let mut rows: Vec<&[String; 2]> = Vec::new();
    for one in records.iter().filter(|one| !one.compared) {
        rows.extend(one.learned_on.as_ref().filter(|row| !rows.contains(row)));
    }
    rows.sort_by_key(|[kind, task]| (kind, TASKS.iter().position(|t| t.name() == task)));
    let groups = by_variant(records);
    let columns = groups.iter().map(|group| {
        let one = group[0];
        format!("{} {}, {}", one.task().title(), one.variant(), one.titles[0])
    });
    let mut table = Table::new(["learned on".to_owned()].into_iter().chain(columns));
    let of = |row: &[String; 2], group: &[&Record]| {
        let here = |one: &&Record| one.task == group[0].task && one.original == group[0].original;
        let found = records.iter().filter(here).find(|one| one.learned_on.as_ref() == Some(row));
        found.map(|one| one.last.as_slice())
    };
    let errors: Vec<Vec<_>> =
        rows.iter().map(|row| groups.iter().map(|group| of(row, group)).collect()).collect();
    for ([kind, task], row) in rows.iter().zip(&errors) {
        let title = TASKS.iter().find(|t| t.name() == task).map_or(&**task, |task| task.title());
        let called = if kind.is_empty() { title.to_owned() } else { format!("{title}, {kind}") };
        let cells = row.iter().enumerate().map(|(k, error)| {
            let column = errors.iter().filter_map(|row| row[k].map(mean));
            let lowest = column.fold(f64::INFINITY, f64::min);
            error.map_or(String::new(), |error| match mean(error) == lowest {
                true => format!("**{}**", with_interval(error)),
                false => with_interval(error),
            })
        });
        table.push([called].into_iter().chain(cells));
    }
    (!rows.is_empty()).then_some(table)
}

/// The kind of what comes with the programs, and the task that it was learned on.
pub(crate) fn learned_on(cell: &Cell) -> Option<[String; 2]> {
    let task = cell.task.name();
    let kind = match &cell.method.softness {
        Some(SoftnessChoice::Preset) if is_preset_learned(task) => String::new(),
        Some(SoftnessChoice::Learned(kind)) => kind.clone().unwrap_or_default(),
        _ => return None,
    };
    match cell.purpose {
        Purpose::Crossed(from) => {
            let own = kind.strip_prefix(from).map(|kind| kind.trim_start_matches('-').to_owned());
            Some([own.unwrap_or(kind), from.to_owned()])
        }
        Purpose::Compared => Some([kind, task.to_owned()]),
        Purpose::Varied(_) => None,
    }
}
