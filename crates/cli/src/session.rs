use std::path::PathBuf;

use serde_json::json;
use softrast_lab::{
    Cache, OutputFolder, Progress, Runner, format::line, program::Output, report::Report,
};

/// What a command works with, beside its flags.
pub(crate) struct Session {
    /// The command line that gives the same results again.
    pub(crate) again: String,
    /// Name of the command.
    pub(crate) command: &'static str,
    /// Name of the task.
    pub(crate) task: &'static str,
    /// Where results go.
    pub(crate) out: PathBuf,
    pub(crate) quiet: bool,
}

impl Session {
    /// The folder for the results.
    pub(crate) fn folder(&self) -> anyhow::Result<OutputFolder> {
        Ok(OutputFolder::open(&self.out)?)
    }

    /// Somebody to run experiments, who keeps what is finished on file unless the command is `solve`.
    pub(crate) fn runner(&self, folder: &OutputFolder, resume: bool) -> anyhow::Result<Runner> {
        let progress = Progress::of_program(self.quiet);
        let path = folder.file(&format!("{}.jsonl", self.command));
        let cache = match (self.command, resume) {
            ("solve", _) => Cache::in_memory(),
            (_, false) => Cache::fresh(&path),
            (_, true) => {
                let (cache, note) = Cache::open(&path)?;
                note.iter().for_each(|note| eprintln!("{note}"));
                cache
            }
        };
        Ok(Runner { progress, cache })
    }

    /// Writes the page, and the JSON if it has a `file` of its own, beside what `folder` holds, and says where they are. `beside` says
    /// what lies beside the page.
    pub(crate) fn finish(
        &self,
        mut folder: OutputFolder,
        page: Report,
        beside: &str,
        file: Option<&str>,
        mut output: Output,
    ) -> anyhow::Result<Output> {
        for (key, value) in [("task", self.task), ("command", self.command)] {
            output.json[key] = value.into();
        }
        output.json["out"] = json!(self.out);
        output.text.push(line("report", &self.out.join(PAGE).display().to_string()));
        folder.stage(PAGE, page.finish(&self.again, beside).as_bytes())?;
        if let Some(file) = file {
            folder.stage(file, &serde_json::to_vec_pretty(&output.json)?)?;
        }
        folder.commit(if file == Some(RESULT) { &OF_RUNS } else { &[] })?;
        Ok(output)
    }
}

const PAGE: &str = "report.html";
/// The results of runs, as JSON.
pub(crate) const RESULT: &str = "result.json";
/// Files that tell of the last runs; those that a command does not write again would tell of others.
const OF_RUNS: [&str; 15] = [
    "curve.csv",
    "convergence.csv",
    "against_curve.csv",
    "before_after.png",
    "animation.gif",
    "result.svg",
    "overlay.png",
    "overlay-*",
    "poses.csv",
    "views.png",
    "mesh.obj",
    "mesh.ply",
    "mesh.glb",
    PAGE,
    RESULT,
];
