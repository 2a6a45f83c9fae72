//! Records in groups, and their numbers in short form.

use softrast_lab::{mean, mean_interval};

use crate::{Record, TASKS, measured::short};

/// Records per task and variant, in the order of the tables, without those only in Table 6.
pub(crate) fn by_variant(records: &[Record]) -> Vec<Vec<&Record>> {
    let places = TASKS.iter().flat_map(|task| [true, false].map(|original| (task.name, original)));
    let group = |place| {
        let of = |one: &&Record| one.compared && (one.task.as_str(), one.original) == place;
        records.iter().filter(of).collect::<Vec<_>>()
    };
    places.map(group).filter(|group| !group.is_empty()).collect()
}

/// Mean, with its interval if there are several runs.
pub(crate) fn with_interval(errors: &[f64]) -> String {
    let (mean, [low, high]) = (short(mean(errors)), mean_interval(errors).map(short));
    if errors.len() == 1 { mean } else { format!("{mean} ({low} to {high})") }
}
