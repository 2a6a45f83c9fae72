use serde_json::json;
use softrast_inverse::ScheduledSoftness;
use softrast_lab::{
    Error, Evaluation, Experiment, OutputFolder, Partial, Run, Runner, Work, check_held_out,
    format::exact,
    halving::{Halving, SearchAxis, SearchSpace, Setting, TRAINING_SEED, rounded},
    program::Output,
    report::{Beside, Report},
    seeds, was_interrupted,
};
use softrast_softness::Softness;

use super::{
    evaluate::names_of_runs,
    runs::{Finished, write},
    with_resume_hint,
};
use crate::{
    MethodArgs, Purpose, Schedule, SoftnessChoice, Task, TaskExperiment, Variant,
    command_line::{Search, Shared},
    session::{Session, TRIED, TRIED_TABLE},
    task::HARD,
};

/// Half a decade.
const RATIO: f64 = 3.162_277_660_168_379_5;
/// Most steps from the last scale of the default decay to its first.
const STEPS: f64 = 4.0;
/// Indices of the axes.
const SCALE: usize = 0;
const END: usize = 1;
const RATE: usize = 2;
const SURROGATE: usize = 3;
const RATE_END: usize = 4;
const OWN: usize = 5;
/// Range of a surrogate's width, as a multiple of the scale.
const SURROGATES: [f64; 2] = [0.7, 6.0];
/// Range of the learning rate at the end, as a share of that at the start.
const RATE_ENDS: [f64; 2] = [0.05, 0.5];

/// Searches for the best setting, then evaluates it on held-out seeds.
pub(crate) fn search<T: Task>(
    session: &Session,
    mut flags: Search<T::Args>,
) -> anyhow::Result<Output> {
    flags.shared.method.reconcile().map_err(Error::usage)?;
    let Shared { args, common, method } = &flags.shared;
    let base = TaskExperiment::<T>::new(args, common, method, Purpose::Finding)?;
    let space = space::<T>(&flags, &base)?;
    let set_own = base.task.own_axis(args).map(|own| own.set);
    let make = |setting: &Setting| {
        let (mut args, mut method) = (args.clone(), method.clone());
        if let Some(scale) = setting[SCALE] {
            let schedule = if setting[END].is_some() { Schedule::Decay } else { Schedule::Static };
            (method.scale, method.scale_end) = (Some(scale), setting[END]);
            method.schedule = Some(schedule);
            method.surrogate_scale = setting[SURROGATE].or(method.surrogate_scale);
        }
        method.learning_rate = setting[RATE].or(method.learning_rate);
        method.rate_end = setting[RATE_END].or(method.rate_end);
        if let (Some(set), Some(Some(value))) = (set_own, setting.get(OWN)) {
            set(&mut args, *value);
        }
        TaskExperiment::<T>::new(&args, common, &method, Purpose::Finding)
    };
    let training = seeds(TRAINING_SEED, flags.training.search_runs);
    let held_out = seeds(common.seed, flags.runs.unwrap_or(base.description.runs));
    check_held_out(&training, &held_out)?;
    session.claim(names_of_runs::<T>(true, false).chain([TRIED, TRIED_TABLE]))?;
    let mut folder = session.folder()?;
    let mut runner = session.runner(&mut folder, flags.kept)?;
    let score = base.metrics()[HARD];
    let score_name = [score.name, score.unit];
    let mut halving = Halving::new(space.clone(), score_name, training, flags.loops);
    let steps = [base.steps(), base.steps() * held_out.len()];
    let mut boxed = |setting: &Setting| Ok(Box::new(make(setting)?) as Box<dyn Experiment>);
    let tried = halving.run(&mut runner, steps, &mut boxed);
    runner.progress.finish();
    let best = tried.map_err(|error| with_resume_hint(error, runner.store.kept()))?.clone();
    halving.best_flags = all_flags(common.variant, method, &space, &best);
    let found = make(&best)?;
    if flags.kept.shard.is_some() {
        let job = Work { experiment: &found, seeds: &held_out, pictures: true };
        return session.part(&mut runner, &[job]);
    }
    let (evaluation, stopped) = match halving.partial() {
        Some(_) => (Evaluation::default(), true),
        None => on_held_out(&mut runner, &found, &held_out)?,
    };
    let returned = |run: &Run| run.returned(HARD).map_or(f64::NAN, |point| point.values[HARD]);
    halving.held_out = evaluation.runs.iter().map(returned).collect();
    folder.stage(TRIED_TABLE, halving.csv().as_bytes())?;
    folder.stage(TRIED, &serde_json::to_vec_pretty(&halving.json())?)?;
    if evaluation.runs.is_empty() {
        return stopped_early::<T>(session, folder, &halving);
    }
    let finished = Finished { experiment: &found, evaluation: &evaluation };
    let mut summary = finished.summary(true)?;
    summary.warnings.extend(halving.warnings());
    let partial = Partial { finished: evaluation.runs.len(), asked: held_out.len() };
    summary.partial = stopped.then_some(partial);
    write(session, folder, &finished, None, &summary, Some(&halving))
}

/// Writes the results of a search that ended before the first held-out run.
fn stopped_early<T: Task>(
    session: &Session,
    folder: OutputFolder,
    halving: &Halving,
) -> anyhow::Result<Output> {
    let mut report = Report::new(T::NAME, T::ABOUT);
    halving.section(&mut report)?;
    let json = json!({ "partial": halving.done(), "search": halving.json() });
    let mut text = vec![format!("{}: search stopped early", T::NAME)];
    text.extend(halving.text());
    let partial = Some(format!("{}, no held-out run", halving.done().of("runs")));
    let output = Output { json, text, warnings: halving.warnings(), partial };
    session.finish(
        folder,
        report,
        &[TRIED, TRIED_TABLE].map(|file| Beside::new(file, "every setting tried")),
        None,
        output,
    )
}

/// Evaluates the best setting, and returns whether the user stopped that early.
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
        Err(failed) => Err(with_resume_hint(failed, runner.store.kept())),
    }
}

/// The search space: values fixed by the command line are fixed, ranges that it gives are searched, everything else is
/// searched around the task's own numbers. For silhouettes, half of the settings have a surrogate.
fn space<T: Task>(
    flags: &Search<T::Args>,
    base: &TaskExperiment<T>,
) -> anyhow::Result<SearchSpace> {
    let Shared { args, method, .. } = &flags.shared;
    let is_family = matches!(method.softness, None | Some(SoftnessChoice::Family(_)));
    if !is_family && !flags.scales.is_empty() {
        return Err(Error::usage("a softness file holds its own scale: leave out --scales"));
    }
    if flags.no_surrogate && base.method.softness.surrogate.is_some() && !is_family {
        return Err(Error::usage(
            "a softness file holds its own surrogate: leave out --no-surrogate",
        ));
    }
    let around = match (is_family, flags.scales.as_slice()) {
        (false, _) => Vec::new(),
        (_, []) => T::searched_scales(scales_around(&base.method.softness, base.solve.size)),
        (_, given) => given.to_vec(),
    };
    let rates = match flags.learning_rates.as_slice() {
        [] => geometric(base.solve.learning_rate, RATIO, -1..=1),
        given => given.to_vec(),
    };
    let axis = |flag, fixed: Option<f64>, values: &[f64]| match fixed {
        Some(fixed) => SearchAxis::spanning(flag, &[fixed]),
        None => SearchAxis::spanning(flag, values),
    };
    let none: &[f64] = &[];
    let ends = if method.schedule == Some(Schedule::Static) { none } else { &around };
    let optional = method.schedule != Some(Schedule::Decay);
    let end = SearchAxis { optional, ..axis("scale-end", method.scale_end, ends) };
    let has_surrogate = T::MOVES_EDGES && base.task.faces().is_some() && !flags.no_surrogate;
    let wider: Vec<f64> =
        around.iter().flat_map(|scale| SURROGATES.map(|ratio| scale * ratio)).collect();
    let wider = if has_surrogate && method.surrogate_scale.is_none() { &wider } else { none };
    let surrogate = SearchAxis { optional: true, ..SearchAxis::spanning("surrogate-scale", wider) };
    // A given rate is fixed unless its end is given too; an adaptive schedule moves the rate itself.
    let stays = method.learning_rate.is_some() || base.method.softness.adaptive.is_some();
    let falls = if stays { none } else { &RATE_ENDS };
    let mut axes = vec![
        axis("scale", method.scale, &around),
        end,
        axis("learning-rate", method.learning_rate, &rates),
        surrogate,
        SearchAxis {
            optional: method.rate_end.is_none(),
            ..axis("rate-end", method.rate_end, falls)
        },
    ];
    axes.extend(base.task.own_axis(args).map(|own| SearchAxis::spanning(own.flag, &own.values)));
    let space = SearchSpace { axes, valid: is_valid };
    if !space.is_free() {
        return Err(Error::usage(
            "there is nothing to choose from: fix less, or give ranges with --scales and --learning-rates",
        ));
    }
    Ok(space)
}

/// Whether a decay narrows, and a surrogate's width is in its range.
fn is_valid(setting: &Setting) -> bool {
    let [scale, end, surrogate] = [SCALE, END, SURROGATE].map(|axis| setting[axis]);
    let Some(scale) = scale else { return true };
    let [least, most] = SURROGATES.map(|ratio| ratio * scale);
    end.is_none_or(|end| end < scale) && surrogate.is_none_or(|one| (least..=most).contains(&one))
}

/// Scales around the first and the last one of a softness on images of `size` pixels a side.
///
/// They range from one below the narrower of the two to the wider, or two to either side if both
/// are equal. Neighbours are half a decade apart, as widths in NDC: a decade if `squared` is true.
fn scales_around(softness: &ScheduledSoftness, size: usize) -> Vec<f64> {
    let [scale, end] = [0.0, 1.0].map(|progress| softness.scale_at(progress, size));
    let ratio = if softness.softness.scale_is_squared() { RATIO * RATIO } else { RATIO };
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

/// The flags of a setting of this method and variant.
fn all_flags(
    variant: Variant,
    method: &MethodArgs,
    space: &SearchSpace,
    setting: &Setting,
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
    // Explicit, since a scale alone could be misread in a task whose default is a decay.
    if setting[SCALE].is_some() && setting[END].is_none() {
        flags.push("--schedule static".into());
    }
    flags.push(space.flags(setting));
    flags.join(" ")
}

#[cfg(test)]
mod tests {
    use softrast_softness::{EdgeSoftness, Family};

    use super::*;

    fn around(squared: bool, first: f64, last: f64) -> Vec<f64> {
        let softness = {
            let edge = if squared { EdgeSoftness::squared } else { EdgeSoftness::new };
            edge(Family::Gauss)
        };
        scales_around(&ScheduledSoftness::decay(softness, first, last), 64)
    }

    #[test]
    fn the_scales_of_the_task_lie_among_those_that_are_tried() {
        assert_eq!(around(false, 0.03, 0.002), [0.000811, 0.002, 0.00493, 0.0122, 0.03]);
        assert_eq!(around(false, 0.01, 0.01), [0.001, 0.00316, 0.01, 0.0316, 0.1]);
        assert_eq!(around(true, 1e-4, 1e-4), [1e-6, 1e-5, 1e-4, 1e-3, 1e-2]);
    }
}
