use std::{
    ffi::OsString,
    path::{Path, PathBuf},
};

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
    /// Softness family or file and further flags, as the command line of the task has them.
    pub method: String,
    /// Seeds, from 0 on.
    pub runs: u32,
    /// What it is for.
    pub purpose: Purpose,
}

/// Where a cell is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// In all tables and charts but Table 6.
    Compared,
    /// As one that only varies another: a dot on the charts of error against seconds, but no curve.
    Varied,
    /// In Table 6 alone.
    Crossed,
}

impl Cell {
    /// Family or file.
    pub fn softness(&self) -> &str {
        self.method.split_whitespace().next().unwrap_or_default()
    }

    /// Name of the softness: that of its file without folder and ending, or of the family.
    pub fn softness_name(&self) -> &str {
        let stem = Path::new(self.softness()).file_stem().and_then(|stem| stem.to_str());
        stem.unwrap_or(self.softness())
    }

    /// Whether the softness was learned and comes with the programs.
    pub fn is_shipped(&self) -> bool {
        let name = self.softness();
        name.starts_with("learned") && !name.ends_with(".json")
    }

    /// The task that what comes with the programs was learned on, and what it is called there.
    pub(crate) fn learned_on(&self) -> Option<(TaskName, String)> {
        let kind = self.method.strip_prefix("learned")?;
        let on = |from: TaskName| {
            let kind = kind.strip_prefix('-')?.strip_prefix(from.name())?;
            (kind.is_empty() || kind.starts_with('-')).then(|| (from, format!("learned{kind}")))
        };
        let other = TaskName::ALL.into_iter().find_map(on);
        other.or_else(|| Some((self.task, self.method.clone())))
    }

    /// Name of the method: the softness, and the flags without what every flag has.
    pub fn method_name(&self) -> String {
        let flags = self.method.split_whitespace().skip(1).filter(|word| *word != "--schedule");
        let words = flags.map(|word| word.trim_start_matches("--"));
        std::iter::once(self.softness_name()).chain(words).collect::<Vec<_>>().join(" ")
    }

    /// Folder of its results in `out`.
    pub fn folder(&self, out: &Path) -> PathBuf {
        let Self { task, variant, runs, .. } = self;
        let method = self.method_name().replace([' ', '='], "-");
        out.join(format!("{}-{variant}-{method}-{runs}", task.name()))
    }

    /// Evaluates the cell in a folder of its own in `out`, on a backend that the task's program names unless the
    /// method has its own; what is finished there is not done again.
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
        let Self { task, variant, method, runs, .. } = self;
        let folder = self.folder(out);
        let runs = runs.to_string();
        let line = [
            task.name(),
            "evaluate",
            "--json",
            "--variant",
            variant,
            "--runs",
            &runs,
            "--softness",
        ];
        let line = line.into_iter().chain(method.split_whitespace());
        let mut words: Vec<OsString> = line.map(OsString::from).collect();
        words.extend(["--out".into(), folder.clone().into_os_string()]);
        let backend = backend.filter(|_| !method.contains("--backend"));
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
        Measured::new(self.clone(), &json)?.with_traces(&folder)
    }
}
