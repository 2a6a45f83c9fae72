//! The tables of the paper with our figures.

use softrast_cli::Variant;
use softrast_lab::{mean, median, paired_among, report::Table, wilson_interval};

use crate::{
    Record,
    groups::{by_variant, with_interval},
    measured::short,
};

/// Returned hard error above which a run has not found its pose.
const FAILS: f64 = 0.05;

/// Table 2: properties of each task.
pub(crate) fn tasks(records: &[Record]) -> Table {
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
    for group in by_variant(records) {
        let one = group[0];
        let hard = one.titles[0].clone();
        let parameter = parameter_title(one).unwrap_or_else(|| "none".to_owned());
        table.push([
            one.task().title.to_owned(),
            one.variant().to_owned(),
            one.faces.to_string(),
            format!("{0} × {0}", one.size),
            one.steps.to_string(),
            hard,
            parameter,
            one.task().paper.freedom[usize::from(!one.original)].to_owned(),
        ]);
    }
    table
}

/// Table 3: the rows of one task in one variant.
pub(crate) fn errors(group: &[&Record]) -> Table {
    let first = group[0];
    let (hard, parameter) = (first.titles[0].clone(), parameter_title(first));
    let has_parameter = parameter.is_some();
    let mut head = vec![
        "method".to_owned(),
        "setting".into(),
        hard,
        format!("difference to {}", first.method),
        "median".into(),
    ];
    head.extend(parameter);
    head.push("success".into());
    let mut table = Table::new(head);
    let compared = group.iter().filter(|one| !one.varied);
    let comparisons = compared.clone().count() - 1;
    for one in compared {
        let to_first = match one.method == first.method {
            true => String::new(),
            false => difference(comparisons, &one.returned, &first.returned),
        };
        let star = if one.chosen { "" } else { " *" };
        let mut row = vec![
            one.method.clone(),
            format!("{}{star}", one.setting),
            with_interval(&one.returned),
            to_first,
            short(median(&one.returned)),
        ];
        row.extend(has_parameter.then(|| with_interval(&one.parameter)));
        row.push(format!("{:.0} %", 100.0 * one.success_rate()));
        table.push(row);
    }
    table
}

/// Methods with one property changed, next to the method as it is, if that is among the records; none if no record is changed.
pub(crate) fn variations(records: &[Record]) -> Option<Table> {
    let mut table = Table::new([
        "task",
        "method",
        "change",
        "hard error",
        "hard error, changed",
        "s a run",
        "s a run, changed",
    ]);
    let mut any = false;
    for group in by_variant(records) {
        for one in group.iter().filter(|one| one.varied) {
            any = true;
            let change = |whole: &Record| one.method.strip_prefix(&whole.method)?.strip_prefix(' ');
            let whole = group.iter().filter(|other| !other.varied && change(other).is_some());
            let whole = whole.max_by_key(|other| other.method.len());
            let [error, seconds] = whole.map_or([String::new(), String::new()], |whole| {
                [short(mean(&whole.returned)), short(whole.seconds)]
            });
            table.push([
                named_task(one),
                whole.map_or(one, |whole| whole).method.clone(),
                whole.and_then(|whole| change(whole)).unwrap_or_default().to_owned(),
                error,
                short(mean(&one.returned)),
                seconds,
                short(one.seconds),
            ]);
        }
    }
    any.then_some(table)
}

/// Table 3 as the paper prints it, for its softnesses: ours has a fixed width, or one that narrows.
fn paper(records: &[Record]) -> Table {
    let mut table =
        Table::new(["task", "variant", "softness", "paper", "ours, static", "ours, decay"]);
    for group in by_variant(records) {
        let first = group[0];
        for (family, _) in first.task().paper.table3 {
            let printed = first.task().paper.printed(family, first.original);
            let ours = |end: &str| {
                let of = |one: &&&Record| {
                    !one.varied && one.family == *family && one.method.ends_with(end)
                };
                group.iter().find(of).map_or(String::new(), |one| pair(one.in_papers_unit))
            };
            table.push([
                first.task().title.to_owned(),
                first.variant().to_owned(),
                (*family).to_owned(),
                printed.map(pair).unwrap_or_default(),
                ours(" static"),
                ours(" decay"),
            ]);
        }
    }
    table
}

/// Table 5: cost of a run.
pub(crate) fn seconds(records: &[Record]) -> Table {
    let mut table = Table::new(["task", "variant", "method", "seconds a run", "ms a step"]);
    for one in by_variant(records).into_iter().flatten().filter(|one| !one.varied) {
        table.push([
            one.task().title.to_owned(),
            one.variant().to_owned(),
            one.method.clone(),
            short(one.seconds),
            short(1e3 * one.seconds / one.steps.max(1) as f64),
        ]);
    }
    table
}

/// Summary of Table 3: the preset next to the best searched fixed width and the best searched decay, by mean and median returned hard error;
/// in bold if the preset's mean is significantly below both.
pub(crate) fn summary(records: &[Record]) -> Table {
    let mut table = Table::new([
        "task",
        "seeds",
        "preset",
        "best family, scale searched",
        "best family, decay searched",
    ]);
    for group in by_variant(records) {
        let Some(preset) = group.iter().find(|one| one.method == "preset") else { continue };
        let searched = |end: &str| {
            let of = |one: &&&Record| !one.varied && one.chosen && one.method.ends_with(end);
            let families = group.iter().filter(of).filter(|one| !one.family.is_empty());
            families.min_by(|a, b| mean(&a.returned).total_cmp(&mean(&b.returned)))
        };
        let others = [searched(" static"), searched(" decay")];
        let known = others.iter().flatten().count();
        let clear = others
            .iter()
            .flatten()
            .all(|other| paired_among(known, &preset.returned, &other.returned).1[1] < 0.0);
        let both = |errors: &[f64]| format!("{}, {}", short(mean(errors)), short(median(errors)));
        let shown = both(&preset.returned);
        let named = |one: Option<&&Record>| {
            one.map_or(String::new(), |one| {
                let seeds = match one.returned.len() {
                    count if count == preset.returned.len() => String::new(),
                    count => format!(", {count} seeds"),
                };
                format!("{} ({}{seeds})", both(&one.returned), one.family)
            })
        };
        let [fixed, decay] = others.map(named);
        table.push([
            named_task(preset),
            preset.returned.len().to_string(),
            if clear && known > 0 { format!("**{shown}**") } else { shown },
            fixed,
            decay,
        ]);
    }
    table
}

/// Failing runs and the errors of the others, per variant and method.
fn poses(records: &[Record]) -> Table {
    let mut table = Table::new([
        "variant",
        "method",
        "seeds",
        "failing",
        "returned",
        "difference to preset",
        "median",
        "mean of the rest",
        "s a run",
    ]);
    for group in by_variant(records) {
        let preset = group.iter().find(|one| one.method == "preset");
        for one in &group {
            let returned = &one.returned;
            let (fails, rest): (Vec<f64>, Vec<f64>) = returned.iter().partition(|x| **x > FAILS);
            let [low, high] = wilson_interval(fails.len(), returned.len()).map(|x| 100.0 * x);
            let other = preset.filter(|preset| preset.method != one.method);
            let to_preset =
                other.map(|preset| difference(group.len() - 1, returned, &preset.returned));
            table.push([
                one.variant().to_owned(),
                one.method.clone(),
                returned.len().to_string(),
                format!("{} ({low:.1} to {high:.1} %)", fails.len()),
                with_interval(returned),
                to_preset.unwrap_or_default(),
                short(median(returned)),
                short(mean(&rest)),
                short(one.seconds),
            ]);
        }
    }
    table
}

/// Mean and interval of the differences on common seeds; in bold if significant among this many `comparisons`.
fn difference(comparisons: usize, errors: &[f64], reference: &[f64]) -> String {
    let (mean, [low, high]) = paired_among(comparisons, errors, reference);
    if errors.len() == 1 {
        return short(mean);
    }
    let shown = format!("{} ({} to {})", short(mean), short(low), short(high));
    if high < 0.0 || low > 0.0 { format!("**{shown}**") } else { shown }
}

/// Title of the parameter error; none where the hard error stands in for it, as for 2D SHAPE.
fn parameter_title(one: &Record) -> Option<String> {
    let [hard, parameter] = &one.titles;
    (!parameter.starts_with(hard.as_str())).then(|| parameter.clone())
}

/// Name of the task, with its variant unless that is the original.
fn named_task(one: &Record) -> String {
    format!("{}{}", one.task().title, if one.original { "" } else { ", transfer" })
}

fn pair(errors: [Option<f64>; 2]) -> String {
    errors.into_iter().flatten().map(short).collect::<Vec<_>>().join(" / ")
}

/// The table of this name: `tasks`, `summary`, `paper`, `seconds`, `poses`, `crossed`, `variations`, or `errors TASK VARIANT`; none if there is
/// nothing to show.
///
/// # Errors
///
/// If there is no table of this name.
pub(crate) fn named(records: &[Record], name: &str) -> anyhow::Result<Option<Table>> {
    let words: Vec<&str> = name.split_whitespace().collect();
    Ok(match words[..] {
        ["tasks"] => Some(tasks(records)),
        ["summary"] => Some(summary(records)),
        ["paper"] => Some(paper(records)),
        ["seconds"] => Some(seconds(records)),
        ["poses"] => Some(poses(records)),
        ["variations"] => variations(records),
        ["crossed"] => crate::crossed::crossed(records),
        ["errors", task, variant] => {
            let original = variant == Variant::Original.name();
            let groups = by_variant(records);
            let of = |group: &&Vec<&Record>| group[0].task == task && group[0].original == original;
            groups.iter().find(of).map(|group| errors(group))
        }
        _ => anyhow::bail!("there is no table {name:?}"),
    })
}
