//! Table 6 of the paper: the softness learned on one task, used on another.

use softrast_lab::{mean, report::Table};

use crate::{
    Record, TASKS,
    groups::{by_variant, with_interval},
};

/// Errors of the softness learned on each task, on all tasks; the lowest of a column in bold. None if nothing is crossed.
pub(crate) fn crossed(records: &[Record]) -> Option<Table> {
    let mut rows: Vec<&[String; 2]> = Vec::new();
    for one in records.iter().filter(|one| !one.compared) {
        rows.extend(one.learned_on.as_ref().filter(|row| !rows.contains(row)));
    }
    rows.sort_by_key(|[kind, task]| (kind, TASKS.iter().position(|t| t.name == task)));
    let groups = by_variant(records);
    let columns = groups.iter().map(|group| {
        let one = group[0];
        format!("{} {}, {}", one.task().title, one.variant(), one.titles[0])
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
        let title = TASKS.iter().find(|t| t.name == task).map_or(&**task, |task| task.title);
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
