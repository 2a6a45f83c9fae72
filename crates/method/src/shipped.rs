//! Softnesses that were learned on the tasks and come with the program.

use softrast_runner::{Command, Settings, SoftnessChoice};
use softrast_softness::{DepthSoftnessFile, ScheduledSoftness};

use crate::defaults::is_scaled;

#[cfg(test)]
const EXAMPLE: &str = r#"{"softness": {"family": "gauss", "squared": false}, "phi": [0],
    "path": {"knots": [-3, -5], "floor_px": 0.03}, "learning_rate": 0.7, "note": "by hand"}"#;

fn is_there(name: &str) -> bool {
    ScheduledSoftness::learned_names().any(|known| known == name) || cfg!(test) && name == "example"
}

/// The softness that is shipped under a name of [`asked_for`].
///
/// # Errors
///
/// If the file that is part of the program is broken.
pub fn softness(name: &str) -> anyhow::Result<Option<ScheduledSoftness>> {
    #[cfg(test)]
    if name == "example" {
        return Ok(Some(ScheduledSoftness::parse(EXAMPLE, "example".as_ref())?));
    }
    let learned = is_there(name).then(|| ScheduledSoftness::learned(name));
    Ok(learned.transpose()?)
}

/// The softness of depths that is shipped beside that of edges under a name of [`asked_for`].
///
/// # Errors
///
/// If the file that is part of the program is broken.
pub fn depth_softness(edge: &str) -> anyhow::Result<Option<DepthSoftnessFile>> {
    let known = DepthSoftnessFile::learned_names().any(|name| name == edge);
    Ok(known.then(|| DepthSoftnessFile::learned(edge)).transpose()?)
}

/// The name of what `learned-KIND` means on a task: that of this kind for the task, or else what was learned on the task of
/// that name.
pub fn called(task: &str, kind: &str) -> String {
    let own = format!("{task}-{kind}");
    let others = !is_there(&own) && is_there(kind);
    if others { kind.to_owned() } else { own }
}

/// The name of what a command line means among what is shipped, whether it is there or not: it says so, or it has something
/// to solve, says nothing of the softness, and there is one for the task.
pub fn asked_for(settings: &Settings, task: &str) -> Option<String> {
    match &settings.softness {
        Some(SoftnessChoice::Learned(None)) => Some(task.to_owned()),
        Some(SoftnessChoice::Learned(Some(kind))) => Some(called(task, kind)),
        Some(SoftnessChoice::Named(_) | SoftnessChoice::File(_)) => None,
        None => {
            // A search, a choice and learning begin with a family.
            let solves = matches!(settings.command, Command::Solve | Command::Evaluate);
            let silent = settings.schedule.is_none()
                && settings.surrogate_scale.is_none()
                && settings.init.is_none()
                && !is_scaled(settings);
            (solves && silent && is_there(task)).then(|| task.to_owned())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_learned_on_another_task_goes_by_its_name() {
        let names = [("pose", "mlp"), ("pose", "shape3d"), ("pose", "shape3d-mlp"), ("pose", "x")];
        let called = names.map(|(task, kind)| called(task, kind));
        assert_eq!(called, ["pose-mlp", "shape3d", "shape3d-mlp", "pose-x"]);
        assert_eq!(super::called("pose", "occlusion_depth"), "pose-occlusion_depth");
    }
}
