use std::{collections::BTreeMap, sync::LazyLock};

use serde::Deserialize;

use crate::Schedule;

/// The best setting that `search` found for a softness family on a task's original variant, on training seeds; for
/// OCCLUSION, whose original most settings solve without an error, on the transfer.
///
/// All settings are in `searched.json` next to this file, with their commands: for every task and family a fixed width,
/// a decay, or both.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Searched {
    /// Scale in NDC; of a decay the first.
    pub scale: f64,
    /// Scale at the last step of a decay; `None` for a fixed width.
    pub scale_end: Option<f64>,
    /// Width of the surrogate gradient, of a moving one the first, if it differs.
    #[serde(default)]
    pub surrogate_scale: Option<f64>,
    /// Learning rate in the original variant; `None` means the task's own.
    pub learning_rate: Option<f64>,
    /// Width of the depth softness, if the task has one.
    pub depth_scale: Option<f64>,
    /// Mean over the training seeds of the error that was minimised.
    pub error: f64,
    /// Runs of the search; `None` for a grid search that did not count them.
    #[serde(default)]
    pub loops: Option<usize>,
    /// The flags of the search; without `--loops` those of a grid search.
    pub command: String,
}

/// The settings of a family in a task.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Found {
    #[serde(rename = "static")]
    fixed: Option<Searched>,
    decay: Option<Searched>,
}

type Tasks = BTreeMap<String, BTreeMap<String, Found>>;

static TASKS: LazyLock<Tasks> = LazyLock::new(|| {
    serde_json::from_str(include_str!("searched.json"))
        .expect("searched.json is part of the program and tested")
});

impl Searched {
    /// The setting of a family in a task under the requested schedule; by default the better one if both schedules were
    /// searched, else that under the task's `usual` schedule. `None` if it was not searched.
    pub fn of(
        task: &str,
        family: &str,
        asked: Option<Schedule>,
        usual: Schedule,
    ) -> Option<&'static Self> {
        let Found { fixed, decay } = TASKS.get(task)?.get(family)?;
        if let (None, Some(fixed), Some(decay)) = (asked, fixed, decay) {
            return Some(if fixed.error <= decay.error { fixed } else { decay });
        }
        match asked.unwrap_or(usual) {
            Schedule::Static => fixed.as_ref(),
            Schedule::Decay => decay.as_ref(),
        }
    }

    /// Whether the scale moves.
    pub fn schedule(&self) -> Schedule {
        if self.scale_end.is_some() { Schedule::Decay } else { Schedule::Static }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_whole_and_its_numbers_are_positive() {
        let families = TASKS.iter().flat_map(|(task, found)| found.iter().map(move |f| (task, f)));
        for (task, (family, Found { fixed, decay })) in families {
            assert!(fixed.iter().all(|found| found.scale_end.is_none()), "{task} {family}");
            assert!(decay.iter().all(|f| f.scale_end.is_some_and(|end| end < f.scale)), "{task}");
            for found in fixed.iter().chain(decay) {
                let Searched {
                    scale, scale_end, surrogate_scale, learning_rate, depth_scale, ..
                } = found;
                let numbers =
                    [Some(*scale), *scale_end, *surrogate_scale, *learning_rate, *depth_scale];
                assert!(numbers.into_iter().flatten().all(|x| x > 0.0), "{task} {family}");
                let schedule = found.schedule();
                for usual in [Schedule::Static, Schedule::Decay] {
                    let asked = Searched::of(task, family, Some(schedule), usual);
                    assert_eq!(asked, Some(found));
                }
                let better = Searched::of(task, family, None, schedule).unwrap();
                assert!(better.error <= found.error, "{task} {family}");
            }
        }
        assert_eq!(Searched::of("teapot", "logistic", None, Schedule::Static), None);
    }
}
