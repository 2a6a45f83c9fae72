use anyhow::Context;
use softrast_lab::{
    Comparison, Error, Evaluation, Experiment, Partial, Work,
    program::{Output, say},
    seeds,
};

use super::{
    choose::chosen,
    in_words,
    runs::{Finished, write},
    with_resume_hint,
};
use crate::{
    Answer, Given, Purpose, SoftnessChoice, Task, TaskExperiment,
    command_line::{Auto, Evaluate, Kept, Shared, Solve},
    session::{DRAWING, OF_OTHERS, OF_RUN, OF_RUNS, RESULT, Session},
};

/// Solves one instance, or the user's pictures.
pub(crate) fn solve<T: Task>(
    session: &Session,
    flags: Solve<T::Args, T::Pictures>,
) -> anyhow::Result<Output> {
    let Solve { pictures, mut shared, auto } = flags;
    if let Some(answer) = solve_given::<T>(session, &mut shared, &pictures) {
        return answer;
    }
    session.claim(names_of_runs::<T>(false, false))?;
    let first = prepared::<T>(&mut shared, auto, session, Purpose::Solving)?;
    run(session, &first, None, &[shared.common.seed], false, Kept::default())
}

/// The task's answer for the user's pictures, if the flags name some.
fn solve_given<T: Task>(
    session: &Session,
    shared: &mut Shared<T::Args>,
    pictures: &T::Pictures,
) -> Option<anyhow::Result<Output>> {
    if let Err(wrong) = shared.method.reconcile() {
        return Some(Err(Error::usage(wrong)));
    }
    let Shared { args, common, method } = shared;
    let task = (T::NAME, T::SCALES);
    let given = Given { args, common, method, task, session };
    let answer = T::solve_given(&given, pictures)?;
    Some(answer.and_then(|answer| {
        let Answer { page, output, files, beside } = answer;
        let mut folder = session.folder()?;
        files.iter().try_for_each(|(name, bytes)| folder.stage(name, bytes))?;
        session.finish(folder, page, &beside, Some(RESULT), output)
    }))
}

/// Solves many instances with one or two methods.
pub(crate) fn evaluate<T: Task>(
    session: &Session,
    flags: Evaluate<T::Args>,
) -> anyhow::Result<Output> {
    let Evaluate { mut shared, runs, baseline, kept, auto } = flags;
    if kept.shard.is_some() && shared.method.softness == Some(SoftnessChoice::Auto) {
        let message = "shards may be of different speed, and so choose differently: run choose first, and name what it finds";
        return Err(Error::usage(message));
    }
    session.claim(names_of_runs::<T>(true, baseline.is_some()))?;
    let first = prepared::<T>(&mut shared, auto, session, Purpose::Evaluating)?;
    let second = baseline.map(|method| {
        let method = method.with_defaults_of(&shared.method);
        let Shared { args, common, .. } = &shared;
        TaskExperiment::<T>::new(args, common, &method, Purpose::Evaluating)
    });
    let second = second.transpose().context("--baseline")?;
    let seeds = seeds(shared.common.seed, runs.unwrap_or(first.description.runs));
    // Checks at once what would fail midway.
    seeds.iter().try_for_each(|&seed| first.task.instance(seed).map(drop))?;
    run(session, &first, second.as_ref(), &seeds, true, kept)
}

/// Names of the files of runs.
pub(super) fn names_of_runs<T: Task>(
    many: bool,
    others: bool,
) -> impl Iterator<Item = &'static str> {
    let more = [(many, OF_RUNS), (others, OF_OTHERS), (T::DRAWS, DRAWING)];
    let more = more.into_iter().filter_map(|(is_one, name)| is_one.then_some(name));
    OF_RUN.into_iter().chain(more)
}

/// The experiment of the flags; `--softness auto` is resolved by `choose`.
fn prepared<T: Task>(
    shared: &mut Shared<T::Args>,
    auto: Auto,
    session: &Session,
    purpose: Purpose,
) -> anyhow::Result<TaskExperiment<T>> {
    shared.method.reconcile().map_err(Error::usage)?;
    if shared.method.softness == Some(SoftnessChoice::Auto) {
        let found = chosen::<T>(shared, auto.budget, session)?;
        say(&format!("--softness auto is {}: {}", found.flags(), found.cost()));
        (shared.args, shared.method) = (found.answer.args, found.answer.method);
    }
    TaskExperiment::new(&shared.args, &shared.common, &shared.method, purpose)
}

fn run<T: Task>(
    session: &Session,
    first: &TaskExperiment<T>,
    second: Option<&TaskExperiment<T>>,
    seeds: &[u64],
    many: bool,
    kept: Kept,
) -> anyhow::Result<Output> {
    let mut folder = session.folder()?;
    let mut runner = session.runner(&mut folder, kept)?;
    let experiments: Vec<&dyn Experiment> =
        [Some(first), second].into_iter().flatten().map(|one| one as &dyn Experiment).collect();
    if kept.shard.is_some() {
        let work = |&experiment| Work { experiment, seeds, pictures: true };
        let job: Vec<Work<'_>> = experiments.iter().map(work).collect();
        return session.part(&mut runner, &job);
    }
    let steps: usize = experiments.iter().map(|one| one.steps() * seeds.len()).sum();
    runner.progress.expect(steps);
    let solved = runner.evaluate(&experiments, seeds, true, None);
    runner.progress.finish();
    let (evaluations, stopped) =
        solved.map_err(|error| with_resume_hint(error, runner.store.kept()))?;
    let finished = Finished { experiment: first, evaluation: &evaluations[0] };
    if finished.evaluation.runs.is_empty() {
        return Err(Error::Interrupted.into());
    }
    let is_begun = |(_, evaluation): &(_, &Evaluation)| !evaluation.runs.is_empty();
    let other = second.zip(evaluations.get(1)).filter(is_begun);
    let mut summary = finished.summary(many)?;
    let partial = Partial { finished: summary.outcome.successes[1], asked: seeds.len() };
    summary.partial = stopped.then_some(partial);
    if let Some((second, evaluation)) = other {
        let titles = [title(first, second), title(second, first)];
        let mut about = second.about();
        about.retain(|key, _| ["softness", "parameters", "settings"].contains(&key.as_str()));
        let baseline = Comparison::new(titles, about, first, finished.evaluation, evaluation)?;
        summary.baseline = Some(Box::new(baseline));
    }
    let other = other.map(|(experiment, evaluation)| Finished { experiment, evaluation });
    write(session, folder, &finished, other.as_ref(), &summary, None)
}

/// The name of a method; if both methods have the same, with their differences.
fn title<T: Task>(one: &TaskExperiment<T>, other: &TaskExperiment<T>) -> String {
    if one.name() != other.name() {
        return one.name().to_owned();
    }
    let (settings, others) = (one.settings(), other.settings());
    let differs = settings.iter().filter(|(key, value)| others.get(*key) != Some(value));
    let named = differs.map(|setting| in_words(setting).join(" "));
    [one.name().to_owned()].into_iter().chain(named).collect::<Vec<_>>().join(", ")
}
