use serde_json::json;
use softrast_lab::{
    Error, Evaluation, Experiment, OutputFolder, Partial, Run, Runner, check_held_out,
    format::exact,
    program::Output,
    report::Report,
    seeds,
    sweep::{GridPoint, SearchAxis, SearchSpace, Sweep, TRAINING_SEED, rounded},
    was_interrupted,
};
use softrast_softness::ScheduledSoftness;

use super::{
    ended,
    runs::{Finished, write},
};
use crate::{
    MethodArgs, Purpose, Schedule, SoftnessChoice, Task, TaskExperiment, Variant,
    command_line::{Search, Shared},
    session::Session,
    task::HARD,
};

/// Ratio of neighbours where nothing asks for another: half a decade.
const RATIO: f64 = 3.162_277_660_168_379_5;
/// Most steps from the last scale of the default decay to its first.
const STEPS: f64 = 4.0;
/// Places of the axes.
const SCALE: usize = 0;
const END: usize = 1;
const RATE: usize = 2;
const OWN: usize = 3;

/// Searches for the best setting, then evaluates it on seeds that the search never saw.
pub(crate) fn search<T: Task>(
    session: &Session,
    mut flags: Search<T::Args>,
) -> anyhow::Result<Output> {
    flags.shared.method.reconcile().map_err(Error::usage)?;
    let Shared { args, common, method } = &flags.shared;
    let base = TaskExperiment::<T>::new(args, common, method, Purpose::Finding)?;
    let space = space::<T>(&flags, &base)?;
    let set_own = base.task.own_axis(args).map(|own| own.set);
    let make = |point: &GridPoint| {
        let (mut args, mut method) = (args.clone(), method.clone());
        if let Some(scale) = point[SCALE] {
            let schedule = if point[END].is_some() { Schedule::Decay } else { Schedule::Static };
            (method.scale, method.scale_end) = (Some(scale), point[END]);
            method.schedule = Some(schedule);
        }
        method.learning_rate = point[RATE].or(method.learning_rate);
        if let (Some(set), Some(Some(value))) = (set_own, point.get(OWN)) {
            set(&mut args, *value);
        }
        TaskExperiment::<T>::new(&args, common, &method, Purpose::Finding)
    };
    let training = seeds(TRAINING_SEED, flags.training.search_runs);
    let held_out = seeds(common.seed, flags.runs.unwrap_or(base.description.runs));
    check_held_out(&training, &held_out)?;
    let mut folder = session.folder()?;
    let mut runner = session.runner(&folder, flags.resume.resume)?;
    let score = base.metrics()[HARD];
    let mut sweep = Sweep::new(space.clone(), [score.name, score.unit], training);
    let steps = [base.steps(), base.steps() * held_out.len()];
    let tried = sweep
        .run(&mut runner, steps, &mut |point| Ok(Box::new(make(point)?) as Box<dyn Experiment>));
    runner.progress.finish();
    let best = tried.map_err(|error| ended(error, runner.cache.kept()))?.point.clone();
    sweep.best_flags = all_flags(common.variant, method, &space, &best);
    let found = make(&best)?;
    let (evaluation, stopped) = match sweep.partial() {
        Some(_) => (Evaluation::default(), true),
        None => on_held_out(&mut runner, &found, &held_out)?,
    };
    let last = |run: &Run| run.curve.last().map_or(f64::NAN, |point| point.values[HARD]);
    sweep.held_out = evaluation.runs.iter().map(last).collect();
    folder.stage("search.csv", sweep.csv().as_bytes())?;
    folder.stage("search.json", &serde_json::to_vec_pretty(&sweep.json())?)?;
    if evaluation.runs.is_empty() {
        return stopped_early::<T>(session, folder, &sweep);
    }
    let finished = Finished { experiment: &found, evaluation: &evaluation };
    let mut summary = finished.summary(true)?;
    summary.warnings.extend(sweep.warnings());
    let partial = Partial { finished: evaluation.runs.len(), asked: held_out.len() };
    summary.partial = stopped.then_some(partial);
    write(session, folder, &finished, None, &summary, Some(&sweep))
}

/// Writes what a search found that ended before the first run on other seeds.
fn stopped_early<T: Task>(
    session: &Session,
    folder: OutputFolder,
    sweep: &Sweep,
) -> anyhow::Result<Output> {
    let mut report = Report::new(T::NAME, T::ABOUT);
    sweep.section(&mut report, "learning-rate");
    let json = json!({ "partial": sweep.done(), "search": sweep.json() });
    let mut text = vec![format!("{}: search stopped early", T::NAME)];
    text.extend(sweep.text());
    let partial = Some(format!("{}, no held-out run", sweep.done().of("settings")));
    let output = Output { json, text, warnings: sweep.warnings(), partial };
    session.finish(
        folder,
        report,
        "search.json and search.csv hold every setting tried",
        None,
        output,
    )
}

/// Evaluates what was found, and says whether the user cut that short.
fn on_held_out<T: Task>(
    runner: &mut Runner,
    found: &TaskExperiment<T>,
    seeds: &[u64],
) -> anyhow::Result<(Evaluation, bool)> {
    let evaluated = runner.evaluate(&[found], seeds, true, None);
    runner.progress.finish();
    match evaluated {
        Ok((mut evaluations, stopped)) => Ok((evaluations.remove(0), stopped)),
        Err(stopped) if was_interrupted(&stopped) => Ok((Evaluation::default(), true)),
        Err(failed) => Err(ended(failed, runner.cache.kept())),
    }
}

/// What is tried: what the command line fixes is fixed, what it lists is tried, the rest is a grid around the task's own numbers.
fn space<T: Task>(
    flags: &Search<T::Args>,
    base: &TaskExperiment<T>,
) -> anyhow::Result<SearchSpace> {
    let Shared { args, method, .. } = &flags.shared;
    let is_file =
        matches!(method.softness, Some(SoftnessChoice::File(_) | SoftnessChoice::Learned(_)));
    if is_file && !flags.scales.is_empty() {
        return Err(Error::usage("a softness file holds its own scale: leave out --scales"));
    }
    let around = || T::searched_scales(scales_around(&base.method.softness, base.solve.size));
    let around = if is_file { Vec::new() } else { around() };
    let values = |fixed: Option<f64>, listed: &[f64], own: &[f64]| -> Vec<f64> {
        let values = if listed.is_empty() { own } else { listed };
        let mut values = fixed.map_or_else(|| values.to_vec(), |x| vec![x]);
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let scales = values(method.scale, &flags.scales, &around);
    let ends = values(method.scale_end, &flags.scales, &around);
    let rates = geometric(base.solve.learning_rate, RATIO, -1..=1);
    let rates = values(method.learning_rate, &flags.learning_rates, &rates);
    let [statics, decays] =
        [Schedule::Decay, Schedule::Static].map(|other| method.schedule != Some(other));
    let some = |values: &[f64]| values.iter().copied().map(Some).collect::<Vec<_>>();
    let axis = |flag, values: Vec<Option<f64>>| SearchAxis { flag, values };
    let no_end = (statics || scales.is_empty()).then_some(None);
    let some_end = if decays && !scales.is_empty() { some(&ends) } else { Vec::new() };
    let scales = if scales.is_empty() { vec![None] } else { some(&scales) };
    let mut axes = vec![
        axis("scale", scales),
        axis("scale-end", no_end.into_iter().chain(some_end).collect()),
        axis("learning-rate", some(&rates)),
    ];
    axes.extend(base.task.own_axis(args).map(|own| axis(own.flag, some(&own.values))));
    let valid = |point: &GridPoint| point[END].is_none() || point[END] < point[SCALE];
    let space = SearchSpace { axes, valid };
    if space.coarse().len() < 2 {
        return Err(Error::usage(
            "there is nothing to choose from: fix less, or list more with --scales and --learning-rates",
        ));
    }
    Ok(space)
}

/// Scales around the first and the last one of a softness on images of `size` pixels a side.
///
/// They go from one below the narrower of the two to the wider, or two to either side if they are the same. Neighbours are half a decade
/// apart, as widths in NDC: a decade if `squared` is true.
fn scales_around(softness: &ScheduledSoftness, size: usize) -> Vec<f64> {
    let [scale, end] = [0.0, 1.0].map(|part| softness.scale_at(part, size));
    let ratio = if softness.softness.squared { RATIO * RATIO } else { RATIO };
    let (low, high) = (scale.min(end), scale.max(end));
    let steps = ((high / low).ln() / ratio.ln() - 1e-9).ceil().min(STEPS);
    if steps < 1.0 {
        return geometric(low, ratio, -2..=2);
    }
    geometric(low, (high / low).powf(1.0 / steps), -1..=steps as i32)
}

fn geometric(from: f64, ratio: f64, steps: std::ops::RangeInclusive<i32>) -> Vec<f64> {
    steps.map(|k| rounded(from * ratio.powi(k))).collect()
}

/// The flags that ask for a point of this method and variant.
fn all_flags(
    variant: Variant,
    method: &MethodArgs,
    space: &SearchSpace,
    point: &GridPoint,
) -> String {
    let mut flags = Vec::new();
    if variant != Variant::Original {
        flags.push(format!("--variant {}", variant.name()));
    }
    flags.extend(method.softness.iter().map(|softness| format!("--softness {softness}")));
    if method.squared {
        flags.push("--squared".into());
    }
    flags.extend(method.surrogate_scale.map(|x| format!("--surrogate-scale {}", exact(x))));
    // Nobody should have to know what a scale alone means to a task that decays by default.
    if point[SCALE].is_some() && point[END].is_none() {
        flags.push("--schedule static".into());
    }
    flags.push(space.flags(point));
    flags.join(" ")
}

#[cfg(test)]
mod tests {
    use softrast_softness::{EdgeSoftness, Family};

    use super::*;

    fn around(squared: bool, first: f64, last: f64) -> Vec<f64> {
        let softness = EdgeSoftness { family: Family::Gauss, squared };
        scales_around(&ScheduledSoftness::decay(softness, first, last), 64)
    }

    #[test]
    fn the_scales_of_the_task_lie_among_those_that_are_tried() {
        assert_eq!(around(false, 0.03, 0.002), [0.000811, 0.002, 0.00493, 0.0122, 0.03]);
        assert_eq!(around(false, 0.01, 0.01), [0.001, 0.00316, 0.01, 0.0316, 0.1]);
        assert_eq!(around(true, 1e-4, 1e-4), [1e-6, 1e-5, 1e-4, 1e-3, 1e-2]);
    }
}
