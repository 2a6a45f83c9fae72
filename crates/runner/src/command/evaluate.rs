use anyhow::Context;
use serde_json::json;

use super::{Finished, Results, ended, out, worker, write};
use crate::{
    Command, Error, Task, against::Against, evaluation, folder::Folder, job::steps,
    prepared::Prepared, settings::CommandLine, summary::Partial,
};

/// Solves one instance, or many with one method or two.
///
/// # Errors
///
/// Those of the task, of the journal and of the output folder; [`Error::Interrupted`] if the user
/// stopped the work before any run was finished.
pub(crate) fn evaluate<T: Task>(
    line: &CommandLine<T::Args>,
    again: &str,
) -> anyhow::Result<Results> {
    let first = Prepared::<T>::new(line.settings.clone(), &line.args)?;
    let second = second::<T>(line).context("--against")?;
    let out = out::<T>(&line.settings);
    let folder = Folder::open(&out)?;
    let seeds = match line.command {
        Command::Solve => vec![line.settings.seed],
        _ => first.seeds(),
    };
    let job = json!({
        "task": T::NAME,
        "command": line.command.name(),
        "seed": seeds[0],
        "runs": seeds.len(),
        "method": first.identity(),
        "against": second.as_ref().map(Prepared::identity),
    });
    let mut worker = worker::<T>(line, &folder, &job)?;
    let mut methods = vec![("method", &first)];
    methods.extend(second.as_ref().map(|second| ("against", second)));
    let all = methods.iter().map(|(_, method)| steps(&method.description, seeds.len())).sum();
    worker.progress.expect(all);
    let solved = evaluation::evaluate(&mut worker, &methods, &seeds);
    worker.progress.finish();
    let (evaluations, stopped) = solved.map_err(|error| ended(error, &worker))?;

    let finished = Finished { prepared: &first, evaluation: &evaluations[0] };
    if finished.evaluation.runs.is_empty() {
        return Err(Error::Interrupted.into());
    }
    let other = second.as_ref().zip(evaluations.get(1));
    let other = other.filter(|(_, evaluation)| !evaluation.runs.is_empty());
    let other = other.map(|(prepared, evaluation)| Finished { prepared, evaluation });
    let mut summary = finished.summary(line.command, out);
    summary.partial = stopped.then_some(Partial { finished: summary.runs, asked: seeds.len() });
    if let Some(Finished { prepared, evaluation }) = &other {
        summary.against = Some(Against::new(
            (&first.description, finished.evaluation),
            (&prepared.description, evaluation),
        ));
    }
    write(folder, &finished, other.as_ref(), &summary, again)?;
    Results::of(&summary)
}

/// The method to compare with, if there is one.
fn second<T: Task>(line: &CommandLine<T::Args>) -> anyhow::Result<Option<Prepared<T>>> {
    let Some(rival) = &line.control.against else {
        return Ok(None);
    };
    Prepared::new(rival.settings(&line.settings)?, &line.args).map(Some)
}
