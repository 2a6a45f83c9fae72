//! Softnesses that were learned on the tasks and come with the program.

use std::path::Path;

use softrast_runner::{Command, Settings, SoftnessChoice};
use softrast_softness::{DepthSoftnessFile, SoftnessFile};

use crate::defaults::is_scaled;

/// Name and text of every file in `data/softness`; a line here makes a file part of the program, such as
/// `("pose", include_str!("../../../data/softness/pose.json")),`.
///
/// The name is that of the task, with `-mlp` or the like behind it for what is not the best one, and at the end `_depth`
/// for a softness of depths.
const SHIPPED: &[(&str, &str)] = &[
    ("shape2d", include_str!("../../../data/softness/shape2d.json")),
    ("shape2d-mlp", include_str!("../../../data/softness/shape2d-mlp.json")),
    ("shape2d-surrogate", include_str!("../../../data/softness/shape2d-surrogate.json")),
    ("shape3d", include_str!("../../../data/softness/shape3d.json")),
    ("shape3d-mlp", include_str!("../../../data/softness/shape3d-mlp.json")),
    ("shape3d-surrogate", include_str!("../../../data/softness/shape3d-surrogate.json")),
    ("pose", include_str!("../../../data/softness/pose.json")),
    ("pose-mlp", include_str!("../../../data/softness/pose-mlp.json")),
    ("pose-surrogate", include_str!("../../../data/softness/pose-surrogate.json")),
    ("occlusion", include_str!("../../../data/softness/occlusion.json")),
    ("occlusion_depth", include_str!("../../../data/softness/occlusion_depth.json")),
    ("occlusion-mlp", include_str!("../../../data/softness/occlusion-mlp.json")),
    ("occlusion-mlp_depth", include_str!("../../../data/softness/occlusion-mlp_depth.json")),
    #[cfg(test)]
    (
        "example",
        r#"{"softness": {"family": "gauss", "squared": false}, "phi": [0],
            "path": {"knots": [-3, -5], "floor_px": 0.03}, "learning_rate": 0.7, "note": "by hand"}"#,
    ),
];

fn text(name: &str) -> Option<&'static str> {
    SHIPPED.iter().find(|(of, _)| *of == name).map(|(_, text)| *text)
}

fn path(name: &str) -> String {
    format!("data/softness/{name}.json")
}

/// The softness that is shipped under a name of [`asked_for`].
///
/// # Errors
///
/// If the file that is part of the program is broken.
pub fn softness(name: &str) -> anyhow::Result<Option<SoftnessFile>> {
    let parse = |text| SoftnessFile::parse(text, Path::new(&path(name)));
    Ok(text(name).map(parse).transpose()?)
}

/// The softness of depths that is shipped beside that of edges under a name of [`asked_for`].
///
/// # Errors
///
/// If the file that is part of the program is broken.
pub fn depth_softness(edge: &str) -> anyhow::Result<Option<DepthSoftnessFile>> {
    let name = format!("{edge}_depth");
    let parse = |text| DepthSoftnessFile::parse(text, Path::new(&path(&name)));
    Ok(text(&name).map(parse).transpose()?)
}

/// The name of what `learned-KIND` means on a task: that of this kind for the task, or else what was learned on the task of
/// that name.
pub fn called(task: &str, kind: &str) -> String {
    let own = format!("{task}-{kind}");
    let others = text(&own).is_none() && text(kind).is_some() && !kind.ends_with("_depth");
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
            (solves && silent && text(task).is_some()).then(|| task.to_owned())
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

    #[test]
    fn every_shipped_file_is_valid_and_says_where_it_comes_from() {
        for (name, _) in SHIPPED {
            let note = match name.strip_suffix("_depth") {
                Some(task) => depth_softness(task).unwrap().unwrap().note,
                None => softness(name).unwrap().unwrap().note,
            };
            assert!(note.is_some(), "{name}");
        }
    }
}
