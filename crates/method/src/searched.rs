use std::{collections::BTreeMap, sync::LazyLock};

use serde::Deserialize;

/// What `search` found best for a softness family on a task's original variant, on training seeds.
///
/// All that the tasks know of it stands in `searched.json` beside the manifest of this crate, with
/// the command that made each entry: for every task, a setting for every family.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Searched {
    /// Scale, at first if it decays, in NDC.
    pub scale: f64,
    /// Scale at the last step of a decay; none for a static one.
    pub scale_end: Option<f64>,
    /// Learning rate in the original variant; none leaves the task's own.
    pub learning_rate: Option<f64>,
    /// Width of the soft depth, where the task has one.
    pub depth_scale: Option<f64>,
    /// The flags of the search.
    pub command: String,
}

type Tasks = BTreeMap<String, BTreeMap<String, Searched>>;

impl Searched {
    /// The setting of a family in a task; none where nothing was searched for.
    pub fn of(task: &str, family: &str) -> Option<&'static Self> {
        static TASKS: LazyLock<Tasks> = LazyLock::new(|| {
            serde_json::from_str(include_str!("../searched.json"))
                .expect("searched.json is part of the program and tested")
        });
        TASKS.get(task)?.get(family)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_whole_and_its_numbers_are_positive() {
        let text = include_str!("../searched.json");
        let tasks: Tasks = serde_json::from_str(text).unwrap();
        for (task, families) in &tasks {
            for (family, found) in families {
                let Searched { scale, scale_end, learning_rate, depth_scale, .. } = found;
                let numbers = [Some(*scale), *scale_end, *learning_rate, *depth_scale];
                assert!(numbers.into_iter().flatten().all(|x| x > 0.0), "{task} {family}");
                assert!(scale_end.is_none_or(|end| end < *scale), "{task} {family}");
                assert_eq!(Searched::of(task, family), Some(found));
            }
        }
        assert_eq!(Searched::of("teapot", "logistic"), None);
    }
}
