//! The tables of the paper with our figures.

use softrast_cli::{Schedule, Searched, SoftnessChoice, Variant};
use softrast_lab::{mean, paired, report::Table};

use crate::{Cell, MeanError, Measured, Purpose, TASKS, measured::short};

/// The cells of each task in each variant, in the order of the tables, without those of Table 6 alone.
pub(crate) fn by_variant(measured: &[Measured]) -> Vec<Vec<&Measured>> {
    let places = TASKS.iter().flat_map(|task| Variant::ALL.map(|variant| (task.name(), variant)));
    let group = |(task, variant)| {
        let of = |one: &&Measured| one.cell.task.name() == task && one.cell.variant == variant;
        let crossed = |one: &&Measured| matches!(one.cell.purpose, Purpose::Crossed(_));
        measured.iter().filter(of).filter(|one| !crossed(one)).collect::<Vec<_>>()
    };
    places.map(group).filter(|group| !group.is_empty()).collect()
}

/// Table 2: what each task is.
pub(crate) fn tasks(measured: &[Measured]) -> Table {
    let mut table = Table::new([
        "task",
        "variant",
        "faces",
        "image",
        "steps",
        "image error",
        "parameter error",
        "degrees of freedom, paper",
    ]);
    for group in by_variant(measured) {
        let one = group[0];
        let (cell, size) = (&one.cell, one.entry.solve.size);
        let parameter = one.metrics().iter().position(|metric| metric.key == "parameter_error");
        let freedom = cell.task.paper().freedom[usize::from(cell.variant == Variant::Transfer)];
        table.push([
            cell.task.title().to_owned(),
            cell.variant.name().to_owned(),
            one.entry.faces.to_string(),
            format!("{size} × {size}"),
            one.entry.solve.steps.to_string(),
            one.title(one.hard_place()),
            parameter.map(|place| one.title(place)).unwrap_or_default(),
            freedom.to_owned(),
        ]);
    }
    table
}

/// Table 3: the rows of one task in one variant.
pub(crate) fn errors(group: &[&Measured]) -> Table {
    let first = group[0];
    let less = format!("less {}", first.cell.name);
    let parameter = first.metrics().iter().position(|metric| metric.key == "parameter_error");
    let mut table = Table::new([
        "method".to_owned(),
        "setting".into(),
        first.title(first.hard_place()),
        less.clone(),
        "best step".into(),
        less,
        parameter.map(|place| first.title(place)).unwrap_or_default(),
        "success".into(),
        "in the paper's unit".into(),
        "paper".into(),
    ]);
    let (of_first, first_hard) = (first.returned(), first.hard());
    for one in group {
        let (name, hard, returned) = (&one.cell.name, one.hard(), one.returned());
        let less = |errors: &[f64], reference: &[f64]| match *name == first.cell.name {
            true => String::new(),
            false => difference(errors, reference),
        };
        let family = match &one.cell.method.softness {
            Some(SoftnessChoice::Family(family)) => family.name(),
            _ => "",
        };
        let original = one.cell.variant == Variant::Original;
        let printed = one.cell.task.paper().printed(family, original);
        let star = if is_chosen(&one.cell) { "" } else { " *" };
        table.push([
            name.clone(),
            format!("{}{star}", one.setting()),
            with_interval(&hard),
            less(&hard.per_run, &first_hard.per_run),
            short(mean(&returned)),
            less(&returned, &of_first),
            with_interval(&one.parameter()),
            format!("{:.0} %", 100.0 * one.success_rate()),
            pair(one.in_papers_unit()),
            printed.map(pair).unwrap_or_default(),
        ]);
    }
    table
}

/// Table 5: what a run costs.
pub(crate) fn seconds(measured: &[Measured]) -> Table {
    let mut table = Table::new(["task", "variant", "method", "seconds a run", "ms a step"]);
    for one in by_variant(measured).into_iter().flatten() {
        table.push([
            one.cell.task.title().to_owned(),
            one.cell.variant.name().to_owned(),
            one.cell.name.clone(),
            short(one.seconds),
            short(1e3 * one.seconds / one.entry.solve.steps.max(1) as f64),
        ]);
    }
    table
}

/// Whether the setting of a cell was searched for, learned, or named by its flags.
fn is_chosen(cell: &Cell) -> bool {
    let method = &cell.method;
    let Some(SoftnessChoice::Family(family)) = &method.softness else { return true };
    if method.scale.is_some() || method.init.is_some() {
        return true;
    }
    [Schedule::Static, Schedule::Decay].into_iter().any(|usual| {
        Searched::of(cell.task.name(), family.name(), method.schedule, usual).is_some()
    })
}

/// Mean and interval, where there are several runs.
pub(crate) fn with_interval(error: &MeanError) -> String {
    let (mean, [low, high]) = (short(error.mean), error.ci95.map(short));
    if error.per_run.len() == 1 { mean } else { format!("{mean} ({low} to {high})") }
}

/// Mean and interval of the differences on the seeds that both have; in bold where one is clear.
fn difference(errors: &[f64], reference: &[f64]) -> String {
    let (mean, [low, high]) = paired(errors, reference);
    if errors.len() == 1 {
        return short(mean);
    }
    let shown = format!("{} ({} to {})", short(mean), short(low), short(high));
    if high < 0.0 || low > 0.0 { format!("**{shown}**") } else { shown }
}

fn pair(errors: [Option<f64>; 2]) -> String {
    errors.into_iter().flatten().map(short).collect::<Vec<_>>().join(" / ")
}
