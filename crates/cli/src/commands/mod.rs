//! What the commands do.

pub(crate) mod choose;
pub(crate) mod evaluate;
pub(crate) mod learn;
pub(crate) mod learn_args;
pub(crate) mod search;

use softrast_lab::{
    Evaluation, OutputFolder, Summary,
    curves::{Convergence, charts, convergence_csv, csv},
    headline,
    program::Output,
    report::{Report, Table},
};

use crate::{Task, TaskExperiment, diagnostics::diagnostics, program::Session};

/// Files that tell of the last runs; those that a command does not write again would tell of others.
const OF_RUNS: [&str; 7] = [
    "curve.csv",
    "convergence.csv",
    "against_curve.csv",
    "before_after.png",
    "animation.gif",
    "report.html",
    "result.json",
];

/// An experiment and what it came to.
struct Finished<'a, T: Task> {
    experiment: &'a TaskExperiment<T>,
    evaluation: &'a Evaluation,
}

impl<T: Task> Finished<'_, T> {
    fn summary(&self, many: bool) -> anyhow::Result<Summary> {
        let Self { experiment, evaluation } = self;
        let mut summary = Summary::new(*experiment, evaluation, many)?;
        let (settings, size) = (experiment.settings(), experiment.solve.size);
        summary.warnings.extend(diagnostics(&settings, size, &evaluation.runs));
        Ok(summary)
    }
}

/// Writes all files that tell of runs, which `folder` may have others beside, and says what they tell. `before` are lines and sections of
/// the command's own.
fn write<T: Task>(
    session: &Session,
    mut folder: OutputFolder,
    first: &Finished<'_, T>,
    second: Option<&Finished<'_, T>>,
    summary: &Summary,
    before: &Before<'_>,
) -> anyhow::Result<Output> {
    let Finished { experiment, evaluation } = first;
    let (metrics, success) =
        (softrast_lab::Experiment::metrics(*experiment), &experiment.description.success);
    let all = [Some(first), second].into_iter().flatten();
    let convergences: Vec<_> =
        all.map(|one| Convergence::new(metrics, &one.evaluation.runs)).collect();
    if let Some(pictures) = &evaluation.pictures {
        folder.stage("before_after.png", &pictures.before_after)?;
        folder.stage("animation.gif", &pictures.animation)?;
    }
    folder.stage("curve.csv", csv(metrics, &evaluation.runs).as_bytes())?;
    if summary.many {
        let named: Vec<_> = ["method", "against"].into_iter().zip(&convergences).collect();
        folder.stage("convergence.csv", convergence_csv(metrics, &named).as_bytes())?;
    }
    if let Some(second) = second {
        folder.stage("against_curve.csv", csv(metrics, &second.evaluation.runs).as_bytes())?;
    }
    let head = head(experiment, summary);
    let mut report = Report::new(T::NAME, T::ABOUT);
    report.paragraph(&format!("{head}."));
    let stopped = summary
        .partial
        .map(|partial| format!("Stopped: {}; --resume goes on from them", partial.of("runs")));
    report.warnings(&stopped.into_iter().chain(summary.warnings.clone()).collect::<Vec<_>>());
    (before.section)(&mut report);
    summary.section(&mut report, &evaluation.runs, success);
    pictures(&mut report, summary, evaluation);
    report.heading("Convergence");
    for plot in charts(metrics, &convergences) {
        report.chart(&plot.svg()?, "");
    }
    let means = " A line is the mean of all runs, the band around it the 95 % interval of the mean, by the bootstrap.";
    report.note(&format!("All errors should fall to 0.{}", if summary.many { means } else { "" }));
    settings(&mut report, experiment);
    let page = report.finish(
        &session.again,
        &format!(
            "result.json holds all results, curve.csv every error of every run after every step{}",
            before.beside
        ),
    );
    folder.stage("report.html", page.as_bytes())?;

    let mut json = summary.json(&experiment.about(session.command), success);
    json.extend(before.json.clone());
    json.insert("out".into(), session.out.display().to_string().into());
    folder.stage("result.json", &serde_json::to_vec_pretty(&json)?)?;
    folder.commit(&OF_RUNS)?;
    let mut text = vec![head];
    text.extend(before.text.iter().cloned());
    text.extend(summary.text(success));
    text.push(format!("  {:<22} {}", "report", session.out.join("report.html").display()));
    let (warnings, partial) =
        (summary.warnings.clone(), summary.partial.map(|partial| partial.of("runs")));
    Ok(Output { json: json.into(), text, warnings, partial })
}

/// What a command has to say before the results of its runs.
struct Before<'a> {
    json: serde_json::Map<String, serde_json::Value>,
    text: Vec<String>,
    section: &'a dyn Fn(&mut Report),
    /// What lies beside the page beside the usual.
    beside: &'static str,
}

impl Before<'_> {
    fn nothing() -> Self {
        Self { json: serde_json::Map::new(), text: Vec::new(), section: &|_| {}, beside: "" }
    }
}

fn head<T: Task>(experiment: &TaskExperiment<T>, summary: &Summary) -> String {
    let what = format!("{} ({})", T::NAME, experiment.variant.name());
    let name = softrast_lab::Experiment::name(experiment);
    headline(&what, name, experiment.parameters(), experiment.solve.steps, &summary.seeds())
}

fn pictures(report: &mut Report, summary: &Summary, evaluation: &Evaluation) {
    let Some(pictures) = &evaluation.pictures else { return };
    let which = match summary.many {
        false => String::new(),
        true => format!(" Shown is seed {}, the first.", summary.seed),
    };
    report.heading("Pictures");
    report.picture(
        &pictures.before_after,
        &format!(
            "From left to right: the target, the image before the first step, the image of the step that is returned, and the \
             difference of target and result: red where the target is brighter, blue where the result is brighter, white where \
             they agree.{which}"
        ),
    );
    let caption = "The image during the optimisation (right) beside its target (left).";
    report.picture(&pictures.animation, caption);
}

/// Every choice behind the numbers.
fn settings<T: Task>(report: &mut Report, experiment: &TaskExperiment<T>) {
    let mut about = experiment.about("");
    about.retain(|key, value| !value.is_object() && !["task", "command"].contains(&key.as_str()));
    let rows = about.into_iter().chain(experiment.settings());
    let row = |(key, value): (String, serde_json::Value)| {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        [key.replace('_', " "), value]
    };
    report.heading("Settings");
    report.table(&Table::pairs(rows.map(row)));
    report.note(
        "The softness is the smooth step that stands for the hard edge of a face, so that the image changes smoothly with the scene; \
         its scale is the width of that step.",
    );
}

/// An error that ended the work, with a word on what is kept.
fn ended(error: anyhow::Error, kept: usize) -> anyhow::Error {
    if kept == 0 || softrast_lab::was_interrupted(&error) {
        return error;
    }
    error.context("what was finished before is kept, and --resume goes on from it")
}
