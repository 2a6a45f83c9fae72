use serde_json::json;

use super::{Results, ended, out, worker};
use crate::{
    Choice, Command, Settings, SoftnessChoice, Stage, Task,
    choose::{choose_with, tried},
    folder::{self, Folder},
    job::Worker,
    prepared::{Prepared, seeds},
    progress::Progress,
    quantity::Quantity,
    report,
    search::{TRAINING_SEED, check_held_out},
    settings::CommandLine,
};

/// Training seeds that every answer is tried on unless asked for another number.
const RUNS: usize = 8;

/// Finds the cheapest way to solve the task that is as good as the best, and gives its reasons.
///
/// # Errors
///
/// Those of the task, of the journal and of the output folder, and if no method gave finite numbers.
pub(crate) fn choose<T: Task>(line: &CommandLine<T::Args>, again: &str) -> anyhow::Result<Results> {
    let mut folder = Folder::open(&out::<T>(&line.settings))?;
    let base = Prepared::<T>::new(tried(&line.settings), &line.args)?;
    let training = training(line);
    let job = json!({
        "task": T::NAME,
        "command": line.command.name(),
        "training_runs": training.len(),
        "method": base.identity(),
    });
    let mut worker = worker::<T>(line, &folder, &job)?;
    let choice = chosen(line, &base, &training, &mut worker)?;
    let score = Quantity::score(&base.description, base.task.score()).measure(&base.description);
    let head = format!(
        "{} ({}): the cheapest within one standard error of the best, by {} of what is returned on {} \
         training seeds",
        T::NAME,
        line.settings.variant.name(),
        score.name,
        training.len()
    );
    let out = out::<T>(&line.settings);
    let mut lines = vec![head.clone()];
    lines.extend(choice.stages.iter().flat_map(table));
    lines.push(format!("  {:<12} {}", "chosen", choice.flags()));
    lines.push(format!("  {:<12} {}", "price", choice.price()));
    lines.push(format!("  {:<12} {}", "report", out.join(folder::REPORT).display()));
    let unfinished = "the time budget ended before everything was tried";
    let warnings: Vec<String> =
        (!choice.whole).then(|| unfinished.to_owned()).into_iter().collect();
    let json = json!({
        "task": T::NAME,
        "command": line.command.name(),
        "variant": line.settings.variant.name(),
        "score": score.name,
        "training_seed": TRAINING_SEED,
        "training_runs": training.len(),
        "flags": choice.flags(),
        "choice": choice,
        "warnings": warnings,
        "out": out,
    });
    folder.stage(folder::CHOICE, &serde_json::to_vec_pretty(&json)?)?;
    let page = report::of_choice(T::NAME, &head, &choice, again);
    folder.stage(folder::REPORT, page.as_bytes())?;
    folder.commit()?;
    Ok(Results { json: json.to_string(), text: lines.join("\n"), warnings, partial: None })
}

/// Puts what [`choose`] finds in the place of `--softness auto`; a line that says it.
///
/// # Errors
///
/// Those of the task, and if no method gave finite numbers.
pub(crate) fn resolve<T: Task>(line: &mut CommandLine<T::Args>) -> anyhow::Result<Option<String>> {
    if line.settings.softness != Some(SoftnessChoice::AUTO) || line.command == Command::Choose {
        return Ok(None);
    }
    let progress = match line.settings.quiet {
        true => Progress::quiet(&crate::interrupt::STOP),
        false => Progress::visible(&crate::interrupt::STOP),
    };
    let mut worker = Worker { progress, journal: None };
    let base = Prepared::<T>::new(tried(&line.settings), &line.args)?;
    let choice = chosen(line, &base, &training(line), &mut worker)?;
    let says = format!("--softness auto is {}: {}", choice.flags(), choice.price());
    line.settings = Settings { command: line.settings.command, ..choice.settings };
    Ok(Some(says))
}

fn chosen<T: Task>(
    line: &CommandLine<T::Args>,
    base: &Prepared<T>,
    training: &[u64],
    worker: &mut Worker,
) -> anyhow::Result<Choice> {
    check_held_out(training, &base.seeds())?;
    let budget = line.control.budget;
    let choice = choose_with::<T>(&line.settings, &line.args, training, budget, worker);
    worker.progress.finish();
    choice.map_err(|error| ended(error, worker))
}

fn training<A: clap::Args>(line: &CommandLine<A>) -> Vec<u64> {
    seeds(TRAINING_SEED, line.control.search_runs.unwrap_or(RUNS))
}

/// The reasons of a stage, in columns as wide as their widest cell.
fn table(stage: &Stage) -> Vec<String> {
    let rows = stage.table();
    let width = |k: usize| rows.iter().map(|row| row[k].len()).max().unwrap_or(0);
    let widths: [usize; 6] = std::array::from_fn(width);
    let line = |row: &[String; 6]| {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}"));
        format!("  {}", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}
