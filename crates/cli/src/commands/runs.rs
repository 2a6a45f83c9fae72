//! Results of runs, as files, a page, JSON and lines.

use softrast_lab::{
    Evaluation, Experiment, OutputFolder, Run, Summary,
    curves::{Convergence, charts, convergence_csv, csv},
    halving::Halving,
    headline,
    program::Output,
    report::{Beside, Report},
};

use super::settings_section;
use crate::{
    Task, TaskExperiment,
    diagnostics::diagnostics,
    session::{DRAWING, OF_OTHERS, OF_RUNS, RESULT, Session, TRIED, TRIED_TABLE},
};

/// An experiment and its results.
pub(super) struct Finished<'a, T: Task> {
    pub(super) experiment: &'a TaskExperiment<T>,
    pub(super) evaluation: &'a Evaluation,
}

impl<T: Task> Finished<'_, T> {
    pub(super) fn summary(&self, many: bool) -> anyhow::Result<Summary> {
        let Self { experiment, evaluation } = self;
        let mut summary = Summary::new(*experiment, &evaluation.runs, evaluation.seconds, many)?;
        let (softness, size) = (&experiment.method.softness, experiment.solve.size);
        summary.warnings.extend(diagnostics(softness, size, &evaluation.runs));
        Ok(summary)
    }

    fn convergence(&self) -> Convergence {
        Convergence::new(self.experiment.metrics(), &self.evaluation.runs)
    }
}

/// Writes all files of runs to `folder`, which may have others, and returns their summary. `search`
/// is the search that found the method.
pub(super) fn write<T: Task>(
    session: &Session,
    mut folder: OutputFolder,
    first: &Finished<'_, T>,
    second: Option<&Finished<'_, T>>,
    summary: &Summary,
    search: Option<&Halving>,
) -> anyhow::Result<Output> {
    let Finished { experiment, evaluation } = first;
    let (metrics, success) = (experiment.metrics(), &experiment.description.success);
    let all = [Some(first), second].into_iter().flatten();
    let convergences: Vec<_> = all.map(Finished::convergence).collect();
    if let Some(pictures) = &evaluation.pictures {
        folder.stage("before_after.png", &pictures.before_after)?;
        folder.stage("animation.gif", &pictures.animation)?;
        if let Some(drawing) = &pictures.drawing {
            folder.stage(DRAWING, drawing.as_bytes())?;
        }
    }
    folder.stage("curve.csv", csv(metrics, &evaluation.runs).as_bytes())?;
    if summary.outcome.many {
        let named: Vec<_> = ["method", "baseline"].into_iter().zip(&convergences).collect();
        folder.stage(OF_RUNS, convergence_csv(metrics, &named).as_bytes())?;
    }
    if let Some(second) = second {
        folder.stage(OF_OTHERS, csv(metrics, &second.evaluation.runs).as_bytes())?;
    }
    let what = format!("{} ({})", T::NAME, experiment.variant.name());
    let (parameters, steps) = (experiment.parameters(), experiment.solve.steps);
    let head = headline(&what, experiment.name(), parameters, steps, &summary.seeds());
    let page = page(first, &convergences, summary, &head, search)?;
    let mut json = summary.json(&experiment.about(), success);
    json.extend(search.map(|search| ("search".to_owned(), search.json())));
    let mut text = vec![head];
    text.extend(search.into_iter().flat_map(Halving::text));
    text.extend(summary.text(success));
    let (warnings, partial) = (summary.warnings.clone(), summary.partial.map(|p| p.of("runs")));
    let output = Output { json: json.into(), text, warnings, partial };
    let mut beside = vec![
        Beside::new(RESULT, "all results and settings"),
        Beside::new("curve.csv", "every error of every run after every step"),
    ];
    beside.extend(
        search.into_iter().flat_map(|_| {
            [TRIED, TRIED_TABLE].map(|file| Beside::new(file, "every setting tried"))
        }),
    );
    session.finish(folder, page, &beside, Some(RESULT), output)
}

fn page<T: Task>(
    first: &Finished<'_, T>,
    convergences: &[Convergence],
    summary: &Summary,
    head: &str,
    search: Option<&Halving>,
) -> anyhow::Result<Report> {
    let Finished { experiment, evaluation } = first;
    let mut report = Report::new(T::NAME, T::ABOUT);
    report.paragraph(&format!("{head}."));
    let stopped = summary.partial.map(|partial| partial.of("runs"));
    report.stopped(stopped.as_deref());
    report.warnings(&summary.warnings);
    if let Some(search) = search {
        search.section(&mut report)?;
    }
    summary.section(&mut report, &evaluation.runs, &experiment.description.success);
    pictures(&mut report, summary, evaluation);
    report.heading("Convergence");
    for plot in charts(experiment.metrics(), convergences) {
        report.chart(&plot.svg()?, "");
    }
    let means =
        " A line is the mean of all runs, the band around it the 95 % interval of the mean.";
    let again = restart_note(&evaluation.runs);
    report.note(&format!(
        "All errors should fall to 0.{}{again}",
        if summary.outcome.many { means } else { "" }
    ));
    let mut about = experiment.about();
    about.retain(|_, value| !value.is_object());
    settings_section(&mut report, [&about, &experiment.settings()]);
    report.note(
        "The softness is the smooth step that stands for the hard edge of a face, so that the image changes smoothly with the scene; \
         its scale is the width of that step.",
    );
    Ok(report)
}

/// A sentence about runs that restarted, if there are any.
fn restart_note(runs: &[Run]) -> String {
    match runs {
        [Run { restarts, .. }] if !restarts.is_empty() => {
            let steps: Vec<String> = restarts.iter().map(usize::to_string).collect();
            format!(" The run stalled and restarted at step {}.", steps.join(" and at step "))
        }
        _ => match runs.iter().filter(|run| !run.restarts.is_empty()).count() {
            0 => String::new(),
            count => format!(" {count} of the runs stalled and restarted."),
        },
    }
}

fn pictures(report: &mut Report, summary: &Summary, evaluation: &Evaluation) {
    let Some(pictures) = &evaluation.pictures else { return };
    let which = match summary.outcome.many {
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
