use anyhow::Context;
use serde_json::json;

use super::{Results, ended, out, worker};
use crate::{
    Command, Schedule, Settings, SoftnessChoice, Task,
    choice::Choice,
    folder::{self, Folder},
    job::Worker,
    ladder,
    prepared::{Prepared, seeds},
    progress::Progress,
    report,
    search::{TRAINING_SEED, check_held_out},
    settings::CommandLine,
};

/// Training seeds that every method is tried on unless asked for another number.
const RUNS: usize = 8;

/// Finds the least complex method that is as good as the best, and gives its reasons.
///
/// # Errors
///
/// Those of the task, of the journal and of the output folder, and if no method gave finite numbers.
pub(crate) fn choose<T: Task>(line: &CommandLine<T::Args>, again: &str) -> anyhow::Result<Results> {
    let folder = Folder::open(&out::<T>(&line.settings))?;
    let base = Prepared::<T>::new(plain(&line.settings), &line.args)?;
    let training = training(line);
    let job = json!({
        "task": T::NAME,
        "command": line.command.name(),
        "training_runs": training.len(),
        "method": base.identity(),
    });
    let mut worker = worker::<T>(line, &folder, &job)?;
    let (choice, whole) = chosen(line, &base, &training, &mut worker)?;
    let score = base.task.score();
    let measure =
        crate::quantity::Quantity::score(&base.description, score).measure(&base.description);
    let flags = choice.flags();
    let head = format!(
        "{} ({}): the least complex method within one standard error of the best, by {} of what is \
         returned on {} training seeds",
        T::NAME,
        line.settings.variant.name(),
        measure.name,
        training.len()
    );
    let mut lines = vec![head.clone()];
    lines.extend(aligned(&choice.table()));
    lines.push(format!("  {:<12} {flags}", "chosen"));
    lines.push(format!("  {:<12} {}", "price", choice.price()));
    let out = out::<T>(&line.settings);
    lines.push(format!("  {:<12} {}", "report", out.join(folder::REPORT).display()));
    let mut warnings = Vec::new();
    if !whole {
        warnings.push(format!(
            "the time budget ended after {} methods: more complex ones were not tried",
            choice.reasons.len()
        ));
    }
    let json = json!({
        "task": T::NAME,
        "command": line.command.name(),
        "variant": line.settings.variant.name(),
        "score": measure.name,
        "training_seed": TRAINING_SEED,
        "training_runs": training.len(),
        "flags": flags,
        "choice": choice,
        "warnings": warnings,
        "out": out,
    });
    let mut folder = folder;
    folder.stage(folder::CHOICE, &serde_json::to_vec_pretty(&json)?)?;
    let page = report::of_choice(T::NAME, &head, &choice, again);
    folder.stage(folder::REPORT, page.as_bytes())?;
    folder.commit()?;
    Ok(Results { json: json.to_string(), text: lines.join("\n"), warnings, partial: None })
}

/// Puts the method that [`choose`] finds in the place of `--softness auto`; a line that says which.
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
    let base = Prepared::<T>::new(plain(&line.settings), &line.args)?;
    let (choice, _) = chosen(line, &base, &training(line), &mut worker)?;
    let method = choice.method();
    let schedule = if method.schedule == "decay" { Schedule::Decay } else { Schedule::Static };
    line.settings = ladder::with(&line.settings, method.softness, schedule);
    Ok(Some(format!("--softness auto is {}: {}", choice.flags(), choice.price())))
}

fn chosen<T: Task>(
    line: &CommandLine<T::Args>,
    base: &Prepared<T>,
    training: &[u64],
    worker: &mut Worker,
) -> anyhow::Result<(Choice, bool)> {
    check_held_out(training, &base.seeds())?;
    worker.progress.expect(ladder::steps(base.description.steps, training.len()));
    let settings = Settings { command: Command::Evaluate, ..base.settings.clone() };
    let climbed = ladder::climb::<T>(&settings, &line.args, training, line.control.budget, worker);
    worker.progress.finish();
    let (rungs, whole) = climbed.map_err(|error| ended(error, worker))?;
    let choice = Choice::among(rungs).context(
        "the numbers stop being finite with every method: try a smaller --learning-rate",
    )?;
    Ok((choice, whole))
}

/// The settings with a softness that a task can prepare; not the learned one, which none of the
/// methods is that there are to choose from.
fn plain(settings: &Settings) -> Settings {
    let auto = settings.softness == Some(SoftnessChoice::AUTO);
    Settings {
        softness: settings.softness.clone().filter(|_| !auto),
        command: Command::Choose,
        ..settings.clone()
    }
}

fn training<A: clap::Args>(line: &CommandLine<A>) -> Vec<u64> {
    seeds(TRAINING_SEED, line.control.search_runs.unwrap_or(RUNS))
}

/// Columns as wide as their widest cell.
fn aligned(rows: &[[String; 7]]) -> Vec<String> {
    let width = |k: usize| rows.iter().map(|row| row[k].len()).max().unwrap_or(0);
    let widths: [usize; 7] = std::array::from_fn(width);
    let line = |row: &[String; 7]| {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}"));
        format!("  {}", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}
