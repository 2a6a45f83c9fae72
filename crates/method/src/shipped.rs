//! Softnesses that were learned on the tasks and come with the program.

use std::path::Path;

use softrast_runner::{Command, Settings, SoftnessChoice};
use softrast_softness::{DepthSoftnessFile, SoftnessFile};

use crate::defaults::is_scaled;

/// Name and text of every file in `data/softness`; a line here makes a file part of the program, such as
/// `("pose", include_str!("../../../data/softness/pose.json")),`.
///
/// The name is that of the task, with `_depth` behind it for a softness of depths.
const SHIPPED: &[(&str, &str)] = &[
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

/// The softness that is shipped for a task.
///
/// # Errors
///
/// If the file that is part of the program is broken.
pub fn softness(task: &str) -> anyhow::Result<Option<SoftnessFile>> {
    let parse = |text| SoftnessFile::parse(text, Path::new(&path(task)));
    Ok(text(task).map(parse).transpose()?)
}

/// The softness of depths that is shipped for a task.
///
/// # Errors
///
/// If the file that is part of the program is broken.
pub fn depth_softness(task: &str) -> anyhow::Result<Option<DepthSoftnessFile>> {
    let name = format!("{task}_depth");
    let parse = |text| DepthSoftnessFile::parse(text, Path::new(&path(&name)));
    Ok(text(&name).map(parse).transpose()?)
}

/// Whether a command line means what is shipped for a task: by name, or because it has something to
/// solve and says nothing of the softness, and there is one.
pub fn is_asked_for(settings: &Settings, task: &str) -> bool {
    match settings.softness {
        Some(SoftnessChoice::Learned) => true,
        Some(SoftnessChoice::Named(_) | SoftnessChoice::File(_)) => false,
        None => {
            // A search, a choice and learning begin with a family.
            let solves = matches!(settings.command, Command::Solve | Command::Evaluate);
            let silent = settings.schedule.is_none()
                && settings.surrogate_scale.is_none()
                && settings.init.is_none()
                && !is_scaled(settings);
            solves && silent && text(task).is_some()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
