//! Records in groups, and their numbers in few letters.

use softrast_lab::{mean, mean_interval};

use crate::{Record, TASKS, measured::short};

/// The records of each task in each variant, in the order of the tables, without those of Table 6 alone.
pub(crate) fn by_variant(records: &[Record]) -> Vec<Vec<&Record>> {
    grouped(records, |one| one.compared.then_some((one.task.as_str(), one.original)))
}

/// What has a task, and whether it is the original, in the order of the tables; what has none is left out.
pub(crate) fn grouped<'a, T>(
    all: &'a [T],
    key: impl Fn(&'a T) -> Option<(&'a str, bool)>,
) -> Vec<Vec<&'a T>> {
    let places =
        TASKS.iter().flat_map(|task| [true, false].map(|original| (task.name(), original)));
    let group = |place| all.iter().filter(|one| key(one) == Some(place)).collect::<Vec<_>>();
    places.map(group).filter(|group| !group.is_empty()).collect()
}

/// Mean and interval, where there are several runs.
pub(crate) fn with_interval(errors: &[f64]) -> String {
    let (mean, [low, high]) = (short(mean(errors)), mean_interval(errors).map(short));
    if errors.len() == 1 { mean } else { format!("{mean} ({low} to {high})") }
}
