use serde_json::json;

use super::{Finished, Results, ended, out, worker, write};
use crate::{
    Error, Task,
    evaluation::{self, Evaluation},
    folder::{self, Folder},
    job::{Worker, steps, was_interrupted},
    prepared::{Prepared, seeds},
    quantity::Quantity,
    report,
    search::{Search, TRAINING_SEED, check_held_out},
    search_summary::SearchSummary,
    settings::CommandLine,
    space::Space,
    summary::Partial,
};

/// Searches for the best setting, then evaluates it on seeds that the search never saw.
///
/// # Errors
///
/// Those of the task, of the journal and of the output folder; [`Error::Interrupted`] if the user
/// stopped the work before any setting was finished.
pub(crate) fn search<T: Task>(line: &CommandLine<T::Args>, again: &str) -> anyhow::Result<Results> {
    let settings = &line.settings;
    let base = Prepared::<T>::new(settings.clone(), &line.args)?;
    let (grid, score) = (base.task.grid(), base.task.score());
    let space = Space::new(settings, &line.control, &grid)?;
    let training = seeds(TRAINING_SEED, line.control.search_runs.unwrap_or(grid.runs).max(1));
    let held_out = base.seeds();
    check_held_out(&training, &held_out)?;
    let folder = Folder::open(&out::<T>(settings))?;
    let job = json!({
        "task": T::NAME,
        "command": line.command.name(),
        "seed": held_out[0],
        "runs": held_out.len(),
        "training_runs": training.len(),
        "score": format!("{score:?}"),
        "coarse": space.coarse().iter().map(|setting| setting.flags()).collect::<Vec<_>>(),
        "fine": grid.fine,
        "method": base.identity(),
    });
    let mut worker = worker::<T>(line, &folder, &job)?;
    let search = Search::<T> {
        settings,
        args: &line.args,
        space: &space,
        score,
        seeds: &training,
        steps: base.description.steps,
        later: steps(&base.description, held_out.len()),
    };
    let tried = search.cells(&mut worker);
    worker.progress.finish();
    let (cells, stopped) = tried.map_err(|error| ended(error, &worker))?;
    let partial =
        stopped.then(|| Partial { finished: cells.len(), asked: search.expected(&cells) });
    let quantity = Quantity::score(&base.description, score);
    let measure = quantity.measure(&base.description);
    let mut found = SearchSummary::new(settings, &space, measure, &training, cells, partial)
        .ok_or(Error::Interrupted)?;

    let best = Prepared::<T>::new(found.best.cell.setting.apply(settings), &line.args)?;
    let (evaluation, cut) = match stopped {
        true => (Evaluation::default(), true),
        false => score_held_out(&mut worker, &best, &held_out)?,
    };
    if evaluation.runs.is_empty() {
        return only_search::<T>(line, folder, found, again);
    }
    found.score_held_out(|point| quantity.of(point), &evaluation.runs);
    let finished = Finished { prepared: &best, evaluation: &evaluation };
    let mut summary = finished.summary(line.command, out::<T>(settings));
    summary.warnings.extend(found.warnings.iter().cloned());
    summary.partial = cut.then_some(Partial { finished: summary.runs, asked: held_out.len() });
    let mut folder = folder;
    stage(&mut folder, &found)?;
    summary.search = Some(found);
    write(folder, &finished, None, &summary, again)?;
    Results::of(&summary)
}

/// Runs the best setting on the held-out seeds; says whether the user cut that short.
fn score_held_out<T: Task>(
    worker: &mut Worker,
    best: &Prepared<T>,
    seeds: &[u64],
) -> anyhow::Result<(Evaluation, bool)> {
    let solved = evaluation::evaluate(worker, &[("best", best)], seeds);
    worker.progress.finish();
    match solved {
        Ok((evaluations, cut)) => Ok((evaluations.into_iter().next().unwrap_or_default(), cut)),
        Err(stopped) if was_interrupted(&stopped) => Ok((Evaluation::default(), true)),
        Err(failed) => Err(ended(failed, worker)),
    }
}

/// Writes what a search has found that was stopped before its best setting was scored.
fn only_search<T: Task>(
    line: &CommandLine<T::Args>,
    mut folder: Folder,
    mut found: SearchSummary,
    again: &str,
) -> anyhow::Result<Results> {
    let all = found.cells.len();
    let partial = *found.partial.get_or_insert(Partial { finished: all, asked: all });
    stage(&mut folder, &found)?;
    let page = report::of_search(T::NAME, T::ABOUT, &found, again);
    folder.stage(folder::REPORT, page.as_bytes())?;
    folder.commit()?;
    let out = out::<T>(&line.settings);
    let json = json!({
        "task": T::NAME,
        "command": line.command.name(),
        "partial": partial,
        "search": found,
        "out": out,
    });
    let mut text = vec![format!("{}: search stopped early", T::NAME)];
    text.extend(found.lines());
    Ok(Results {
        json: json.to_string(),
        text: text.join("\n"),
        warnings: found.warnings,
        partial: Some(format!("{}, no held-out run", partial.says("settings"))),
    })
}

fn stage(folder: &mut Folder, found: &SearchSummary) -> anyhow::Result<()> {
    folder.stage(folder::CELLS, found.csv().as_bytes())?;
    folder.stage(folder::SEARCH, &serde_json::to_vec_pretty(found)?)?;
    Ok(())
}
