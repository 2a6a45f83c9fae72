use std::{ffi::OsString, path::Path};

use anyhow::Context;
use serde_json::Value;
use softrast_runner::execute;

use crate::{Measured, TaskName};

/// A task in one variant, solved with one method.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The task.
    pub task: TaskName,
    /// `original` or `transfer`.
    pub variant: &'static str,
    /// Softness family or file, as the command line of the task has it.
    pub method: String,
    /// Seeds, from 0 on.
    pub runs: u32,
}

impl Cell {
    /// Name of the method: that of its file without folder and ending, or of the family.
    pub fn method_name(&self) -> &str {
        let stem = Path::new(&self.method).file_stem().and_then(|stem| stem.to_str());
        stem.unwrap_or(&self.method)
    }

    /// Evaluates the cell in a folder of its own in `out`, on a backend that the task's program names; what
    /// is finished there is not done again.
    ///
    /// # Errors
    ///
    /// Those of the task's program.
    pub fn evaluate(
        &self,
        out: &Path,
        backend: Option<&str>,
        quiet: bool,
    ) -> anyhow::Result<Measured> {
        let Self { task, variant, method, runs } = self;
        let folder = out.join(format!("{}-{variant}-{}-{runs}", task.name(), self.method_name()));
        let runs = runs.to_string();
        let line = [
            task.name(),
            "evaluate",
            "--json",
            "--variant",
            variant,
            "--softness",
            method,
            "--runs",
            &runs,
        ];
        let mut words: Vec<OsString> = line.into_iter().map(OsString::from).collect();
        words.extend(["--out".into(), folder.clone().into_os_string()]);
        words.extend(backend.into_iter().flat_map(|name| ["--backend".into(), name.into()]));
        words.extend(quiet.then(|| "--quiet".into()));
        words.extend(folder.join("evaluate.jsonl").exists().then(|| "--resume".into()));
        let mut stdout = Vec::new();
        let done = match task {
            TaskName::Shape2d => execute::<shape2d::Shape2d>(words, &mut stdout),
            TaskName::Shape3d => execute::<shape3d::Shape3d>(words, &mut stdout),
            TaskName::Pose => execute::<pose::Pose>(words, &mut stdout),
            TaskName::Occlusion => execute::<occlusion::Occlusion>(words, &mut stdout),
        };
        done.map_err(|failure| anyhow::anyhow!("{}", failure.message)).with_context(|| {
            format!(
                "{} {variant} with {method} (what {folder:?} holds of an earlier comparison may be \
                 deleted)",
                task.name()
            )
        })?;
        let json: Value = serde_json::from_slice(&stdout).context("a result is no JSON")?;
        Measured::new(self.clone(), &json)
    }
}
