use std::path::PathBuf;

use serde_json::json;
use softrast_lab::{
    OutputFolder, Progress, Runner, Store, Work, format::line, program::Output, report::Report,
};

use crate::{command_line::Kept, commands::ended};

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
    pub(crate) fn runner(&self, folder: &OutputFolder, kept: Kept) -> anyhow::Result<Runner> {
        let progress = Progress::of_program(self.quiet);
        let path = folder.file(&format!("{}.jsonl", self.command));
        let store = match kept {
            _ if self.command == "solve" => Store::in_memory(),
            Kept { shard: Some(shard), .. } => Store::of_shard(&path, shard)?,
            Kept { resume: false, .. } => Store::fresh(&path),
            Kept { resume: true, .. } => {
                let (store, note) = Store::open(&path)?;
                note.iter().for_each(|note| eprintln!("{note}"));
                store
            }
        };
        Ok(Runner { progress, store })
    }

    /// Does the part of a job that is the shard's, and says what is still to do. No result file is written.
    pub(crate) fn part(&self, runner: &mut Runner, job: &[Work<'_>]) -> anyhow::Result<Output> {
        let shard = runner.store.shard().map(|shard| shard.to_string()).unwrap_or_default();
        let part = runner.part(job);
        let part = part.map_err(|error| ended(error, runner.store.kept()))?;
        let json = json!({
            "task": self.task, "command": self.command, "out": self.out, "shard": shard, "finished": part.finished,
        });
        let text = vec![
            format!("{}: shard {shard} has finished its {} runs", self.task, part.finished),
            line(
                "then",
                "the same command with --resume instead of --shard, for the results of all shards",
            ),
        ];
        let partial = (part.finished < part.asked).then(|| part.of("runs of this shard"));
        Ok(Output { json, text, partial, ..Output::default() })
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
