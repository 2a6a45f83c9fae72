use anyhow::Context;

use crate::{
    Choice, Command, Error, Progress, Settings, SoftnessChoice, Stage, Task,
    job::Worker,
    ladder::{self, Rung},
    prepared::Prepared,
    trial::Trial,
};

/// Finds the cheapest way to solve a task that is as good as the best: the least complex softness,
/// then the fewest pixels to optimise on, the largest tolerance and the coarsest mesh.
///
/// Every question is asked with the answers to those before; what `settings` name of resolution and
/// tolerance is not asked, nor is what the task does not know. Answers are tried on `seeds`, which
/// should not be those that count, by the task's own score at full size. `budget` is in seconds, for
/// all of it: when the next trial would go beyond, the answers that are left are not tried, but the
/// first always is.
///
/// ```
/// use softrast_runner::{NoArgs, Settings, Task, choose};
///
/// fn cheapest<T: Task<Args = NoArgs>>() -> anyhow::Result<Settings> {
///     let seeds: Vec<u64> = (1_000_000..1_000_008).collect();
///     let choice = choose::<T>(&Settings::default(), &NoArgs {}, &seeds, Some(60.0))?;
///     println!("{}: {}", choice.flags(), choice.price());
///     Ok(choice.settings)
/// }
/// ```
///
/// # Errors
///
/// Those of the task, and if no softness gave finite numbers.
///
/// # Panics
///
/// If there are no seeds.
pub fn choose<T: Task>(
    settings: &Settings,
    args: &T::Args,
    seeds: &[u64],
    budget: Option<f64>,
) -> anyhow::Result<Choice> {
    let mut worker = Worker { progress: Progress::hidden(), journal: None };
    choose_with::<T>(settings, args, seeds, budget, &mut worker)
}

/// [`choose`] by a worker, who may have done part of it before.
pub(crate) fn choose_with<T: Task>(
    settings: &Settings,
    args: &T::Args,
    seeds: &[u64],
    budget: Option<f64>,
    worker: &mut Worker,
) -> anyhow::Result<Choice> {
    assert!(!seeds.is_empty(), "a choice needs seeds to try its answers on");
    let settings = tried(settings);
    let size = Prepared::<T>::new(settings.clone(), args)?;
    let (steps, size) = (size.description.steps, size.description.size);
    let mut climb = Climb::<T> {
        args,
        seeds,
        left: budget.unwrap_or(f64::INFINITY),
        runs: 0,
        steps,
        whole: true,
        worker,
    };
    let mut stages = Vec::new();
    let mut now = None;
    for of in ["softness", "resolution", "tolerance", "detail"] {
        let base = now.as_ref().map_or(&settings, |trial: &Trial| &trial.settings);
        let rungs = match of {
            "softness" => ladder::methods(base),
            "resolution" => ladder::resolutions(base, size),
            "tolerance" => ladder::tolerances(base),
            _ => ladder::details(base, T::prepare(base, args)?.detail()),
        };
        let flags: Vec<&str> =
            stages.iter().map(|stage: &Stage| stage.answer().flags.as_str()).collect();
        let trials = climb.stage(rungs, now.as_ref(), &flags.join(" "))?;
        if now.is_some() && trials.len() < 2 {
            continue;
        }
        let stage = Stage::among(of, &trials).context(
            "the numbers stop being finite with every method: try a smaller --learning-rate",
        )?;
        now = trials.into_iter().nth(stage.chosen);
        stages.push(stage);
    }
    let whole = climb.whole;
    let settings = now.map_or(settings, |trial| trial.settings);
    Ok(Choice { stages, whole, settings })
}

/// The settings as trials start from them: with a softness that a task can prepare. Not the learned
/// one, which is none of the methods that there are to choose from.
pub(crate) fn tried(settings: &Settings) -> Settings {
    let auto = settings.softness == Some(SoftnessChoice::AUTO);
    Settings {
        softness: settings.softness.clone().filter(|_| !auto),
        command: Command::Choose,
        ..settings.clone()
    }
}

/// Trials on the same seeds, for as long as the budget lasts.
struct Climb<'a, T: Task> {
    args: &'a T::Args,
    seeds: &'a [u64],
    /// Seconds left.
    left: f64,
    /// Runs so far, and the steps of each.
    runs: usize,
    steps: usize,
    /// Whether everything was tried so far.
    whole: bool,
    worker: &'a mut Worker,
}

impl<T: Task> Climb<'_, T> {
    /// Tries the answers to one question in their order, and gives those that were tried. The `usual`
    /// one of them has been tried before, with the answers whose flags are `before`.
    ///
    /// The next is expected to take as long as the usual one, or as those so far on average.
    fn stage(
        &mut self,
        rungs: Vec<Rung>,
        usual: Option<&Trial>,
        before: &str,
    ) -> anyhow::Result<Vec<Trial>> {
        self.worker.progress.expect((self.runs + rungs.len() * self.seeds.len()) * self.steps);
        let (mut trials, mut spent) = (Vec::new(), 0.0);
        for rung in rungs {
            let expected = match usual {
                Some(usual) => usual.wall,
                None => spent / trials.len().max(1) as f64,
            };
            let prepared = match Prepared::<T>::new(rung.settings.clone(), self.args) {
                Ok(prepared) => prepared,
                // A task need not know every family, or how to draw on fewer pixels.
                Err(error) if usual.is_some() || !trials.is_empty() => match error.downcast_ref() {
                    Some(Error::Usage(_)) => continue,
                    _ => return Err(error),
                },
                Err(error) => return Err(error),
            };
            if let Some(usual) = usual.filter(|_| rung.usual) {
                trials.push(usual.renamed(rung, &prepared));
                continue;
            }
            let first = usual.is_none() && trials.is_empty();
            if !first && expected > self.left {
                self.whole = false;
                continue;
            }
            let trial = Trial::new(rung, &prepared, before, self.seeds, self.worker)?;
            (self.runs, self.left) = (self.runs + self.seeds.len(), self.left - trial.wall);
            spent += trial.wall;
            trials.push(trial);
        }
        Ok(trials)
    }
}
