//! Table 6 of the paper: what was learned on one task, used on another.

use crate::{
    Cell, Error, Measured, Purpose, TaskName,
    results::{by_variant, with_interval},
    table::Table,
};

pub(crate) const CROSSED: &str = "\
What comes with the program for one task, used on another at that task's own learning rate: the error of the hard image at the last step, mean and
95 % interval, the lowest of a column in bold. The columns have the units of their tasks; compare within a column. Only the softness of edges is
carried over: OCCLUSION's depths are the task's own logistic where the edges are another task's, and what was learned there is used elsewhere without its depths.
";

/// What was learned on each task, on all of them; the lowest of a column in bold.
pub(crate) fn crossed(measured: &[Measured]) -> Option<Table> {
    let mut learned: Vec<(TaskName, String)> = Vec::new();
    for one in measured.iter().filter(|one| one.cell.purpose == Purpose::Crossed) {
        learned.extend(one.cell.learned_on().filter(|row| !learned.contains(row)));
    }
    learned.sort_by_key(|(task, name)| {
        (name.clone(), TaskName::ALL.iter().position(|one| one == task))
    });
    let groups = by_variant(measured);
    let column = |group: &Vec<&Measured>| {
        let Measured { cell, hard, .. } = group[0];
        format!("{} {}, {}", cell.task.title(), cell.variant, hard.name)
    };
    let head = std::iter::once("learned on".to_owned()).chain(groups.iter().map(column)).collect();
    let mut table = Table { head, rows: Vec::new() };
    for row in &learned {
        let called = match row.1.strip_prefix("learned-") {
            Some(kind) => format!("{}, {kind}", row.0.title()),
            None => row.0.title().to_owned(),
        };
        table.rows.push(vec![called]);
    }
    for group in &groups {
        let Cell { task, variant, .. } = group[0].cell;
        let here = |one: &&Measured| (one.cell.task, one.cell.variant) == (task, variant);
        let of = |row: &(TaskName, String)| {
            let mut there = measured.iter().filter(here);
            there.find(|one| one.cell.learned_on().as_ref() == Some(row)).map(|one| &one.hard)
        };
        let errors: Vec<Option<&Error>> = learned.iter().map(of).collect();
        let lowest = errors.iter().flatten().map(|error| error.mean).fold(f64::INFINITY, f64::min);
        for (row, error) in table.rows.iter_mut().zip(errors) {
            row.push(error.map_or(String::new(), |error| match error.mean == lowest {
                true => format!("**{}**", with_interval(error)),
                false => with_interval(error),
            }));
        }
    }
    (!learned.is_empty()).then_some(table)
}
