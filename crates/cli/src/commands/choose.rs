use anyhow::Context;
use serde_json::json;
use softrast_inverse::Resolution;
use softrast_lab::{
    Error, Experiment, Progress, Runner, Store, check_held_out,
    format::{counted, exact, line},
    halving::TRAINING_SEED,
    program::Output,
    report::{Beside, Report},
    seeds,
    select::{Budget, Candidate, Selection, chosen_flags, cost, section},
};
use softrast_raster::ImageSize;
use softrast_softness::Family;

use super::with_resume_hint;
use crate::{
    Detail, Init, MethodArgs, Purpose, Schedule, SoftnessChoice, Task, TaskExperiment,
    command_line::{Choose, Shared},
    session::Session,
};

/// Families by ascending complexity: first by number of parameters, then fixed before moving scale.
///
/// Source: Wu et al. 2024, Table 1, for the numbers of parameters.
const FAMILIES: [Family; 5] =
    [Family::Logistic, Family::Gauss, Family::Exp, Family::Gamma, Family::Mlp];
/// The file of all errors.
const CHOICE: &str = "choose.json";
/// Fewest pixels a side of an image that are tried.
const FEWEST: usize = 8;
/// Largest errors of a pixel, from the default of a decay to that of a fixed width.
const TOLERANCES: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];
/// Default number of training seeds per answer.
const RUNS: usize = 8;

/// Finds the cheapest method for the task that is as good as the best, and reports the reasons.
pub(crate) fn choose<T: Task>(session: &Session, flags: Choose<T::Args>) -> anyhow::Result<Output> {
    let Choose { mut shared, auto, training, kept } = flags;
    shared.method.reconcile().map_err(Error::usage)?;
    if kept.shard.is_some() && auto.budget.is_some() {
        return Err(Error::usage("shards try all answers: leave out --budget"));
    }
    session.claim([CHOICE])?;
    let mut folder = session.folder()?;
    let mut runner = session.runner(&mut folder, kept)?;
    let training = seeds(TRAINING_SEED, training.search_runs);
    let found = find::<T>(&shared, auto.budget, &training, &mut runner);
    runner.progress.finish();
    let found = found.map_err(|error| with_resume_hint(error, runner.store.kept()))?;
    if kept.shard.is_some() {
        return session.part(&mut runner, &[]);
    }
    let (score, variant) = (T::measures().hard, shared.common.variant.name());
    let head = format!(
        "{} ({variant}): the cheapest within one standard error of the best, by {score} of what is returned on {} training seeds",
        T::NAME,
        training.len()
    );
    let mut text = vec![head.clone()];
    text.extend(found.stages.iter().flat_map(|stage| stage.table().lines()));
    text.extend([line("chosen", &found.flags()), line("cost", &found.cost())]);
    let unfinished = "the time budget ended before everything was tried";
    let warnings: Vec<String> = (!found.whole).then(|| unfinished.to_owned()).into_iter().collect();
    let json = json!({
        "variant": variant,
        "score": score,
        "training_seed": TRAINING_SEED,
        "training_runs": training.len(),
        "flags": found.flags(),
        "cost": found.cost(),
        "choice": { "stages": found.stages, "whole": found.whole },
        "warnings": warnings,
    });
    let mut report = Report::new(T::NAME, "What is enough");
    report.paragraph(&format!("{head}."));
    section(&found.stages, &mut report);
    let output = Output { json, text, warnings, partial: None };
    let beside = [Beside::new(CHOICE, "all errors")];
    session.finish(folder, report, &beside, Some(CHOICE), output)
}

/// The method of `--softness auto`.
pub(crate) fn chosen<T: Task>(
    shared: &Shared<T::Args>,
    budget: Option<f64>,
    session: &Session,
) -> anyhow::Result<Found<T::Args>> {
    let progress = Progress::of_program(session.quiet);
    let mut runner = Runner { progress, store: Store::in_memory() };
    let training = seeds(TRAINING_SEED, RUNS);
    let found = find::<T>(shared, budget, &training, &mut runner);
    runner.progress.finish();
    found
}

/// Asks one question after the other, each under the previous answers: the least complex softness,
/// then the fewest pixels to optimise on, the largest tolerance and the coarsest mesh. Questions
/// that the flags answer, or that do not apply to the task, are skipped.
fn find<T: Task>(
    shared: &Shared<T::Args>,
    budget: Option<f64>,
    training: &[u64],
    runner: &mut Runner,
) -> anyhow::Result<Found<T::Args>> {
    if shared.method.surrogate_scale.is_some() {
        return Err(Error::usage(
            "--surrogate-scale does not go with choose or --softness auto, whose methods have what a search found",
        ));
    }
    check_held_out(training, &[shared.common.seed])?;
    // Not the learned softness, which is not one of the candidates.
    let method = MethodArgs { softness: None, ..shared.method.clone() };
    let mut now = Answer { flags: String::new(), args: shared.args.clone(), method };
    let mut budget = Budget { left: budget.unwrap_or(f64::INFINITY), lasted: true };
    let (mut stages, mut runs): (Vec<Selection>, usize) = (Vec::new(), 0);
    for of in ["softness", "resolution", "tolerance", "detail"] {
        let make = |now: &Answer<T::Args>| {
            TaskExperiment::<T>::new(&now.args, &shared.common, &now.method, Purpose::Finding)
        };
        let usual = make(&now)?;
        let answers = match of {
            "softness" => softnesses(&now),
            "resolution" if T::MOVES_EDGES => resolutions(&now, usual.image_size()),
            "tolerance" if T::MOVES_EDGES => tolerances(&now),
            "detail" => details::<T>(&now, &usual.task),
            _ => Vec::new(),
        };
        let mut candidates = Vec::new();
        for answer in answers {
            let experiment = make(&answer)?;
            let (with, flags) = (with(of, &experiment), answer.flags.clone());
            candidates.push(Candidate { flags, with, experiment: Box::new(experiment), answer });
        }
        if candidates.len() < 2 {
            continue;
        }
        runs += candidates.len() * training.len();
        runner.progress.expect(runs * usual.steps());
        let (answer, stage) = runner.select(of, candidates, training, &mut budget)?.context(
            "the numbers stop being finite with every method: try a smaller --learning-rate",
        )?;
        now = answer;
        stages.push(stage);
    }
    Ok(Found { answer: now, stages, whole: budget.lasted })
}

/// The answer to all questions, with its reasons.
pub(crate) struct Found<A> {
    pub(crate) answer: Answer<A>,
    stages: Vec<Selection>,
    /// Whether the time sufficed for all answers.
    whole: bool,
}

impl<A> Found<A> {
    pub(super) fn flags(&self) -> String {
        chosen_flags(&self.stages)
    }

    pub(super) fn cost(&self) -> String {
        cost(&self.stages)
    }
}

/// An answer as flags and their values.
#[derive(Clone)]
pub(crate) struct Answer<A> {
    /// The flags that answer the last question.
    flags: String,
    pub(crate) args: A,
    pub(crate) method: MethodArgs,
}

impl<A: Clone> Answer<A> {
    /// This answer extended by one to the next question.
    fn with(&self, flags: String, change: impl FnOnce(&mut Self)) -> Self {
        let mut answer = Self { flags, ..self.clone() };
        change(&mut answer);
        answer
    }
}

/// The resource that an answer saves.
fn with<T: Task>(of: &str, experiment: &TaskExperiment<T>) -> String {
    let (size, method) = (experiment.image_size(), &experiment.method);
    match of {
        "softness" => counted(experiment.parameters(), "parameter"),
        "resolution" => match method.resolution {
            Resolution::Auto => format!("at most {size} pixels"),
            resolution => format!("{} pixels", resolution.size(size, 1.0)),
        },
        "tolerance" => format!("pixels off by {:e}", method.tolerance()),
        _ => format!("{} faces", experiment.description.faces),
    }
}

/// The softness families with fixed and moving scale, at the scales of the task.
fn softnesses<A: Clone>(now: &Answer<A>) -> Vec<Answer<A>> {
    let schedules = |family| [(family, Schedule::Static), (family, Schedule::Decay)];
    let mut all: Vec<_> = FAMILIES.into_iter().flat_map(schedules).collect();
    // Both fixed families of one parameter come before the moving ones.
    all.swap(1, 2);
    let answer = |(family, schedule): (Family, Schedule)| {
        let name = if schedule == Schedule::Static { "static" } else { "decay" };
        // A random start covers the whole image, and takes over twenty times as long as a logistic.
        let init = (family == Family::Mlp).then_some(Init::Fitted);
        let from = if init.is_some() { " --init fitted" } else { "" };
        now.with(format!("--softness {family}{from} --schedule {name}"), |answer| {
            answer.method = MethodArgs {
                softness: Some(SoftnessChoice::Family(family)),
                schedule: Some(schedule),
                init,
                scale: None,
                scale_end: None,
                ..answer.method.clone()
            };
        })
    };
    all.into_iter().map(answer).collect()
}

/// Resolutions of images of `size`, the fewest pixels first; none if the flags fix it. The automatic one is tried too if the scale moves.
fn resolutions<A: Clone>(now: &Answer<A>, size: ImageSize) -> Vec<Answer<A>> {
    if now.method.resolution.is_some() {
        return Vec::new();
    }
    let sides = Resolution::sizes(size).map(ImageSize::shorter);
    let smaller: Vec<usize> = sides.skip(1).take_while(|&side| side >= FEWEST).collect();
    let moves = now.method.schedule == Some(Schedule::Decay);
    let auto = (moves && !smaller.is_empty()).then_some(Resolution::Auto);
    let smaller = smaller.into_iter().rev().map(Resolution::Side);
    let answer = |resolution: Resolution| {
        let flags = format!("--resolution {resolution}");
        now.with(flags, |answer| answer.method.resolution = Some(resolution))
    };
    smaller.chain(auto).chain([Resolution::Full]).map(answer).collect()
}

/// Tolerances of culling, the largest first; none if the flags fix it.
fn tolerances<A: Clone>(now: &Answer<A>) -> Vec<Answer<A>> {
    let asked = now.method.tolerance.is_some();
    let tolerances = TOLERANCES.into_iter().filter(|_| !asked);
    let answer = |tolerance: f64| {
        let flags = format!("--tolerance {}", exact(tolerance));
        now.with(flags, |answer| answer.method.tolerance = Some(tolerance))
    };
    tolerances.map(answer).collect()
}

/// Levels of detail of the task's mesh, the coarsest first; none if it has no choice.
fn details<T: Task>(now: &Answer<T::Args>, task: &T) -> Vec<Answer<T::Args>> {
    let Some(Detail { flag, values, set }) = task.detail(&now.args) else { return Vec::new() };
    let answer =
        |value: usize| now.with(format!("--{flag} {value}"), |answer| set(&mut answer.args, value));
    values.into_iter().map(answer).collect()
}

#[cfg(test)]
mod tests {
    use softrast_inverse::Method;

    use super::*;

    fn flags(answers: &[Answer<()>]) -> Vec<&str> {
        answers.iter().map(|answer| answer.flags.as_str()).collect()
    }

    #[test]
    fn the_cheapest_comes_first_and_what_is_asked_for_is_not_asked() {
        let still = Answer { flags: String::new(), args: (), method: MethodArgs::default() };
        let sides = ["8", "16", "32", "full"].map(|name| format!("--resolution {name}"));
        assert_eq!(flags(&resolutions(&still, 64.into())), sides);
        let change = |change: fn(&mut MethodArgs)| {
            still.with(String::new(), |answer| change(&mut answer.method))
        };
        let moving = change(|method| method.schedule = Some(Schedule::Decay));
        let expected = ["--resolution 9", "--resolution auto", "--resolution full"];
        assert_eq!(flags(&resolutions(&moving, 18.into())), expected);
        assert_eq!(flags(&resolutions(&moving, 15.into())), ["--resolution full"]);
        let asked = change(|method| method.resolution = Some(Resolution::Auto));
        assert!(resolutions(&asked, 64.into()).is_empty());
        let all = tolerances(&moving);
        assert_eq!(all[3].flags, "--tolerance 1e-5");
        assert_eq!(all[0].method.tolerance, Some(Method::usual_tolerance(true)));
        let softnesses = softnesses(&moving);
        assert_eq!(softnesses[1].flags, "--softness gauss --schedule static");
        assert_eq!(softnesses[9].flags, "--softness mlp --init fitted --schedule decay");
    }
}
