mod choose;
mod evaluate;
mod learn;
mod search;

use std::path::PathBuf;

use serde_json::Value;

use crate::{
    Command, Progress, Settings, Task, chart,
    convergence::Convergence,
    evaluation::Evaluation,
    folder::{self, Folder},
    guidance, interrupt,
    job::{Worker, was_interrupted},
    journal::Journal,
    prepared::Prepared,
    quantity::Quantity,
    report,
    returned::Returned,
    settings::CommandLine,
    summary::Summary,
    table,
};

pub(crate) use choose::{choose, resolve};
pub(crate) use evaluate::evaluate;
pub(crate) use learn::learn;
pub(crate) use search::search;

/// What a command has to say once its files are written.
pub(crate) struct Results {
    /// One object in one line.
    pub(crate) json: String,
    pub(crate) text: String,
    pub(crate) warnings: Vec<String>,
    /// How far the work came if the user stopped it.
    pub(crate) partial: Option<String>,
}

impl Results {
    fn of(summary: &Summary) -> anyhow::Result<Self> {
        Ok(Self {
            json: serde_json::to_string(summary)?,
            text: summary.text(),
            warnings: summary.first_warnings(),
            partial: summary.partial.map(|partial| partial.says("runs")),
        })
    }
}

/// A method and what it has solved.
struct Finished<'a, T> {
    prepared: &'a Prepared<T>,
    evaluation: &'a Evaluation,
}

impl<T: Task> Finished<'_, T> {
    fn summary(&self, command: Command, out: PathBuf) -> Summary {
        let Prepared { settings, description, .. } = self.prepared;
        let mut summary =
            Summary::new(T::NAME, command, settings, description, self.evaluation, out);
        let score = Quantity::score(description, self.prepared.task.score());
        let runs = &self.evaluation.runs;
        summary.warnings.extend(guidance::guidance(description, score, runs));
        summary.returned = Some(Returned::new(description, score, runs));
        summary
    }

    fn convergence(&self) -> Convergence {
        Convergence::new(&self.prepared.description, &self.evaluation.runs)
    }
}

/// Where the results go.
fn out<T: Task>(settings: &Settings) -> PathBuf {
    settings.out.clone().unwrap_or_else(|| PathBuf::from("out").join(T::NAME))
}

/// Somebody to do the parts of the job, with a journal unless there is but one part.
fn worker<T: Task>(
    line: &CommandLine<T::Args>,
    folder: &Folder,
    job: &Value,
) -> anyhow::Result<Worker> {
    let progress = match line.settings.quiet {
        true => Progress::quiet(&interrupt::STOP),
        false => Progress::visible(&interrupt::STOP),
    };
    let path = folder.journal(line.command);
    let journal = match line.command {
        Command::Solve => None,
        _ if line.control.resume => {
            if !path.exists() {
                eprintln!("there is no {}, so nothing to go on from", path.display());
            }
            Some(Journal::resumed(&path, job)?)
        }
        _ => Some(Journal::fresh(&path, job)),
    };
    Ok(Worker { progress, journal })
}

/// An error that ended the work, with a word on what is kept.
fn ended(error: anyhow::Error, worker: &Worker) -> anyhow::Error {
    if worker.kept() == 0 || was_interrupted(&error) {
        return error;
    }
    error.context("what was finished before is kept, and --resume goes on from it")
}

/// An error that ended learning, with a word on what is kept.
fn ended_learning(error: anyhow::Error) -> anyhow::Error {
    error.context("learning stopped; what was learned before is kept, and --resume goes on from it")
}

/// Writes all files that tell of runs, which `folder` may have others beside.
fn write<T: Task>(
    mut folder: Folder,
    first: &Finished<'_, T>,
    second: Option<&Finished<'_, T>>,
    summary: &Summary,
    again: &str,
) -> anyhow::Result<()> {
    let description = &first.prepared.description;
    let Evaluation { runs, pictures, .. } = first.evaluation;
    let convergences: Vec<_> =
        [Some(first), second].into_iter().flatten().map(Finished::convergence).collect();
    let names = ["method", "against"];
    let methods: Vec<_> = names.into_iter().zip(&convergences).collect();
    let shown = Quantity::shown(description, first.prepared.task.score());
    let chart = chart::svg(description, &shown, &convergences)?;
    let page = report::html(T::ABOUT, summary, runs, &chart, pictures.as_ref(), again);
    if let Some(pictures) = pictures {
        folder.stage(folder::BEFORE_AFTER, &pictures.before_after)?;
        folder.stage(folder::ANIMATION, &pictures.animation)?;
    }
    folder.stage(folder::CURVE, table::curve(description, runs).as_bytes())?;
    if summary.command != Command::Solve.name() {
        folder.stage(folder::CONVERGENCE, table::convergence(description, &methods).as_bytes())?;
    }
    if let Some(second) = second {
        let text = table::curve(&second.prepared.description, &second.evaluation.runs);
        folder.stage(folder::AGAINST_CURVE, text.as_bytes())?;
    }
    folder.stage(folder::REPORT, page.as_bytes())?;
    folder.stage(folder::RESULT, &serde_json::to_vec_pretty(summary)?)?;
    Ok(folder.commit()?)
}
