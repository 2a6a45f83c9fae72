//! Records in groups, and their numbers in short form.

use softrast_lab::{mean, mean_interval};

use crate::{Record, TASKS, measured::short};

/// Records per task and variant, in the order of the tables, without those only in Table 6.
pub(crate) fn by_variant(records: &[Record]) -> Vec<Vec<&Record>> {
    grouped(records, |one| one.compared.then_some((one.task.as_str(), one.original)))
}

/// Groups by task and variant (`true` for the original), in the order of the tables; items without a key are excluded.
pub(crate) fn grouped<'a, T>(
    all: &'a [T],
    key: impl Fn(&'a T) -> Option<(&'a str, bool)>,
) -> Vec<Vec<&'a T>> {
    let places =
        TASKS.iter().flat_map(|task| [true, false].map(|original| (task.name(), original)));
    let group = |place| all.iter().filter(|one| key(one) == Some(place)).collect::<Vec<_>>();
    places.map(group).filter(|group| !group.is_empty()).collect()
}

/// Mean, with its interval if there are several runs.
pub(crate) fn with_interval(errors: &[f64]) -> String {
    let (mean, [low, high]) = (short(mean(errors)), mean_interval(errors).map(short));
    if errors.len() == 1 { mean } else { format!("{mean} ({low} to {high})") }
}
