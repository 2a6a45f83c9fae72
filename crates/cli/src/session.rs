use std::{cell::RefCell, path::PathBuf};

use serde_json::json;
use softrast_lab::{
    Inputs, OutputFolder, Progress, Runner, Store, Work,
    format::line,
    program::{Output, say},
    report::{Beside, Report},
    shown,
};

use crate::{command_line::Kept, commands::with_resume_hint};

/// The context of a command, apart from its flags.
pub(crate) struct Session {
    /// The command line that reproduces the results.
    pub(crate) again: String,
    /// Name of the command.
    pub(crate) command: &'static str,
    /// Name of the task, and of its program.
    pub(crate) task: &'static str,
    pub(crate) program: &'static str,
    /// Input files, which it never replaces.
    pub(crate) inputs: RefCell<Inputs>,
    /// Folder for results.
    pub(crate) out: PathBuf,
    pub(crate) quiet: bool,
}

impl Session {
    /// The folder for the results.
    pub(crate) fn folder(&self) -> anyhow::Result<OutputFolder> {
        let command = format!("{} {}", self.program, self.command);
        Ok(OutputFolder::open(&self.out, &command, &self.inputs.borrow())?)
    }

    /// Checks, before the work, that files of these names and the page may be written to the folder.
    pub(crate) fn claim<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> anyhow::Result<()> {
        Ok(self.folder()?.claim(names.into_iter().chain([PAGE]))?)
    }

    /// The runner of experiments, which stores finished runs on file unless the command is `solve`.
    pub(crate) fn runner(&self, folder: &mut OutputFolder, kept: Kept) -> anyhow::Result<Runner> {
        let progress = Progress::of_program(self.quiet);
        if self.command == "solve" {
            return Ok(Runner { progress, store: Store::in_memory() });
        }
        let name = format!("{}.jsonl", self.command);
        let (store, note) = Store::of_command(folder, &name, kept.shard, kept.resume)?;
        note.iter().for_each(|note| say(note));
        Ok(Runner { progress, store })
    }

    /// Makes the shard's runs of a job, and reports the next command. No result file is written.
    pub(crate) fn part(&self, runner: &mut Runner, job: &[Work<'_>]) -> anyhow::Result<Output> {
        let shard = runner.store.shard().map(|shard| shard.to_string()).unwrap_or_default();
        let part = runner.part(job);
        let part = part.map_err(|error| with_resume_hint(error, runner.store.kept()))?;
        let json = json!({
            "task": self.task, "command": self.command, "out": shown(&self.out), "shard": shard, "finished": part.finished,
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

    /// Writes the page, and the JSON if it has its own `file`, to `folder` with its other files,
    /// and reports their paths. `beside` are the files that the page links to.
    pub(crate) fn finish(
        &self,
        mut folder: OutputFolder,
        page: Report,
        beside: &[Beside],
        file: Option<&str>,
        mut output: Output,
    ) -> anyhow::Result<Output> {
        for (key, value) in [("task", self.task), ("command", self.command)] {
            output.json[key] = value.into();
        }
        output.json["out"] = shown(&self.out).into();
        output.text.push(line("report", &self.out.join(PAGE).display().to_string()));
        folder.stage(PAGE, page.finish(&self.again, beside).as_bytes())?;
        if let Some(file) = file {
            folder.stage(file, &serde_json::to_vec_pretty(&output.json)?)?;
        }
        folder.commit()?;
        Ok(output)
    }
}

const PAGE: &str = "report.html";
/// The results of runs, as JSON.
pub(crate) const RESULT: &str = "result.json";
/// Files of runs: of one, of several, of several with two methods, and of a task with drawings.
pub(crate) const OF_RUN: [&str; 4] = ["before_after.png", "animation.gif", "curve.csv", RESULT];
pub(crate) const OF_RUNS: &str = "convergence.csv";
pub(crate) const OF_OTHERS: &str = "against_curve.csv";
pub(crate) const DRAWING: &str = "result.svg";
/// Every setting that a search tried, as JSON and as a table.
pub(crate) const TRIED: &str = "search.json";
pub(crate) const TRIED_TABLE: &str = "search.csv";
