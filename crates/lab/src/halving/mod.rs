//! A search by successive halving: many settings on a few seeds, the better half of them on twice as many, and so on.
//!
//! Half of the work of a round goes to new settings near the best of the previous round. Source: Jamieson and Talwalkar
//! 2016 for the halving; the new settings are an addition.

use std::cmp::Ordering;

use anyhow::Context;
use rand::{SeedableRng, rngs::StdRng};

use crate::{Error, Experiment, Partial, Runner, evaluate::was_interrupted, mean};

mod report;
mod space;

pub use space::{SearchAxis, SearchSpace, Setting, rounded};

/// First of the seeds that settings are compared on, far from the held-out seeds.
pub const TRAINING_SEED: u64 = 1_000_000;

/// Seed of the random settings.
const DRAWN: u64 = 7;
/// Most rounds; each has half the seeds of the next.
const ROUNDS: u32 = 4;
/// The best value is at an end of a range if it is nearer to it than this share of the range.
const EDGE: f64 = 0.03;
/// A setting and its results on the training seeds.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The setting.
    pub setting: Setting,
    /// The last round that it was in, counted from 1.
    round: usize,
    /// The score of the returned step for each seed; `None` if the numbers became non-finite.
    scores: Vec<Option<f64>>,
    /// Number of successful runs.
    successes: usize,
    /// Wall time of the runs.
    seconds: f64,
}

/// A search and its results.
#[derive(Clone, Debug)]
pub struct Halving {
    /// The flags of the best setting, complete.
    pub best_flags: String,
    /// The scores of its returned steps on other seeds.
    pub held_out: Vec<f64>,
    space: SearchSpace,
    /// Name and unit of the score.
    score: [&'static str; 2],
    /// Training seeds.
    seeds: Vec<u64>,
    /// Most runs of the search.
    loops: usize,
    /// The trials so far.
    trials: Vec<Trial>,
    /// Whether the user stopped it.
    stopped: bool,
}

impl Trial {
    /// Mean score over the runs that stayed finite.
    fn mean(&self) -> Option<f64> {
        let finite: Vec<f64> = self.scores.iter().copied().flatten().collect();
        (!finite.is_empty()).then(|| mean(&finite))
    }

    fn broken(&self) -> usize {
        self.scores.iter().filter(|score| score.is_none()).count()
    }
}

/// Makes the experiment of a setting.
pub type MakeSetting<'a> = dyn FnMut(&Setting) -> anyhow::Result<Box<dyn Experiment>> + 'a;

impl Halving {
    /// A search without trials, of at most `loops` runs; `score` has a name and a unit.
    pub fn new(
        space: SearchSpace,
        score: [&'static str; 2],
        seeds: Vec<u64>,
        loops: usize,
    ) -> Self {
        let (best_flags, held_out, trials) = (String::new(), Vec::new(), Vec::new());
        Self { best_flags, held_out, space, score, seeds, loops, trials, stopped: false }
    }

    /// Runs all rounds, until the user stops it, and returns the best setting.
    ///
    /// `each` is the number of steps of a run, `later` that of all runs after the search, for the
    /// progress bar.
    ///
    /// # Errors
    ///
    /// The errors of the experiments and of the store; if no setting is valid or gave finite
    /// numbers; [`Error::Interrupted`] if none has yet.
    pub fn run(
        &mut self,
        runner: &mut Runner,
        [each, later]: [usize; 2],
        make: &mut MakeSetting<'_>,
    ) -> anyhow::Result<&Setting> {
        runner.progress.expect(self.loops * each + later);
        let mut random = StdRng::seed_from_u64(DRAWN);
        let rounds = self.rounds();
        for (k, &seeds) in rounds.iter().enumerate() {
            let settings = self.settings(k, &rounds, &mut random)?;
            self.complete(runner, &settings, seeds, make)?;
            for (i, setting) in settings.iter().enumerate() {
                let label = format!(
                    "round {} of {}, setting {} of {}",
                    k + 1,
                    rounds.len(),
                    i + 1,
                    settings.len()
                );
                match self.trial(runner, setting, [k + 1, seeds], &label, make) {
                    Ok(trial) => self.trials.push(trial),
                    Err(stopped) if was_interrupted(&stopped) => {
                        self.stopped = true;
                        return self.best().map(|best| &best.setting).ok_or(stopped);
                    }
                    Err(failed) => {
                        let flags = self.space.flags(setting);
                        let context =
                            format!("training seeds from {} on with {flags}", self.seeds[0]);
                        return Err(failed.context(context));
                    }
                }
            }
        }
        let best = self.best().map(|best| &best.setting);
        best.context(
            "the numbers stop being finite with every setting: try a smaller --learning-rates",
        )
    }

    /// Number of seeds of each round.
    fn rounds(&self) -> Vec<usize> {
        let mut rounds: Vec<usize> =
            (0..ROUNDS).rev().map(|k| self.seeds.len().div_ceil(1 << k)).collect();
        rounds.dedup();
        // As many rounds as the number of runs allows.
        while rounds.len() > 1 && self.loops < 2 * rounds.len() * rounds[rounds.len() - 1] {
            rounds.remove(0);
        }
        rounds
    }

    /// The settings of a round: the best of the previous round, and new ones near them.
    fn settings(
        &self,
        round: usize,
        rounds: &[usize],
        random: &mut StdRng,
    ) -> anyhow::Result<Vec<Setting>> {
        let work = self.loops / rounds.len();
        let none = "no setting is valid: give wider --scales";
        if round == 0 {
            let drawn = (0..(work / rounds[0]).max(1)).map(|_| self.space.draw(random));
            return drawn.collect::<Option<Vec<_>>>().context(none);
        }
        let kept = (work / 2 / (rounds[round] - rounds[round - 1])).max(1);
        let others = work / 2 / rounds[round];
        let mut before: Vec<&Trial> =
            self.trials.iter().filter(|trial| trial.round == round).collect();
        before.sort_by(|a, b| better_first(a, b));
        before.truncate(kept);
        let mut settings: Vec<Setting> = before.iter().map(|trial| trial.setting.clone()).collect();
        for parent in before.iter().cycle().take(others) {
            settings.push(self.space.near(&parent.setting, random).context(none)?);
        }
        Ok(settings)
    }

    /// Completes a round that shards share.
    fn complete(
        &self,
        runner: &mut Runner,
        settings: &[Setting],
        seeds: usize,
        make: &mut MakeSetting<'_>,
    ) -> anyhow::Result<()> {
        if runner.store.shard().is_none() {
            return Ok(());
        }
        let experiments: Vec<_> = settings.iter().map(&mut *make).collect::<anyhow::Result<_>>()?;
        let experiments: Vec<_> = experiments.iter().map(Box::as_ref).collect();
        runner.complete(&experiments, &self.seeds[..seeds])
    }

    fn trial(
        &self,
        runner: &mut Runner,
        setting: &Setting,
        [round, seeds]: [usize; 2],
        label: &str,
        make: &mut MakeSetting<'_>,
    ) -> anyhow::Result<Trial> {
        let experiment = make(setting)?;
        let seeds = &self.seeds[..seeds];
        let (scores, tried) = runner.score(experiment.as_ref(), seeds, label)?;
        let successes = tried.runs.iter().filter(|run| run.success).count();
        Ok(Trial { setting: setting.clone(), round, scores, successes, seconds: tried.seconds })
    }

    /// Number of runs made. Runs of earlier rounds are not repeated.
    fn made(&self) -> usize {
        self.trials.iter().map(|trial| trial.scores.len() - self.earlier(trial)).sum()
    }

    /// Number of runs of the same setting in earlier rounds.
    fn earlier(&self, trial: &Trial) -> usize {
        let same = self.trials.iter().filter(|one| one.setting == trial.setting);
        same.filter(|one| one.round < trial.round).map(|one| one.scores.len()).max().unwrap_or(0)
    }

    /// Number of runs made, out of the allowed ones, if the user stopped the search.
    pub fn partial(&self) -> Option<Partial> {
        self.stopped.then(|| self.done())
    }

    /// Number of runs made, out of the allowed ones, whether stopped or not.
    pub fn done(&self) -> Partial {
        Partial { finished: self.made(), asked: self.loops }
    }

    fn best(&self) -> Option<&Trial> {
        let last = self.trials.iter().map(|trial| trial.round).max()?;
        let finite =
            self.trials.iter().filter(|trial| trial.round == last && trial.mean().is_some());
        finite.min_by(|a, b| better_first(a, b))
    }

    /// The flags, without dashes, whose best value is at an end of its range.
    fn at_edge(&self) -> Vec<&'static str> {
        let Some(best) = self.best() else { return Vec::new() };
        let edge = |(axis, value): (&SearchAxis, &Option<f64>)| {
            let ([low, high], value) = (axis.range?, (*value)?);
            let part = (value / low).ln() / (high / low).ln();
            (low < high && !(EDGE..=1.0 - EDGE).contains(&part)).then_some(axis.flag)
        };
        self.space.axes.iter().zip(&best.setting).filter_map(edge).collect()
    }

    /// Warnings for the user.
    pub fn warnings(&self) -> Vec<String> {
        let edges = if self.stopped { Vec::new() } else { self.at_edge() };
        let warning = |flag: &str| {
            format!(
                "the best --{flag} lies at the edge of what was tried, and may lie beyond: give --scales, --learning-rates or the \
                 flag itself"
            )
        };
        edges.into_iter().map(warning).collect()
    }
}

/// Orders by fewer failed runs, then by lower mean.
fn better_first(a: &Trial, b: &Trial) -> Ordering {
    let mean = |trial: &Trial| trial.mean().unwrap_or(f64::INFINITY);
    a.broken().cmp(&b.broken()).then(mean(a).total_cmp(&mean(b)))
}

/// Refuses held-out seeds that are also training seeds.
///
/// # Errors
///
/// [`Error::Usage`] that names the training seeds.
pub fn check_held_out(training: &[u64], held_out: &[u64]) -> Result<(), Error> {
    match held_out.iter().find(|seed| training.contains(seed)) {
        None => Ok(()),
        Some(_) => Err(Error::Usage(format!(
            "seeds {} to {} are those that a search trains on: choose another --seed",
            training[0],
            training[training.len() - 1]
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::{space::tests::space, *};

    fn tried(loops: usize, seeds: usize) -> Halving {
        let seeds = (0..seeds as u64).map(|k| TRAINING_SEED + k).collect();
        Halving::new(space(), ["error", ""], seeds, loops)
    }

    fn trial(round: usize, scale: f64, scores: &[f64]) -> Trial {
        let scores = scores.iter().map(|&x| Some(x).filter(|x| x.is_finite())).collect();
        let setting = vec![Some(scale), None, Some(0.3), None];
        Trial { setting, round, scores, successes: 0, seconds: 1.0 }
    }

    #[test]
    fn rounds_double_their_seeds_and_keep_to_the_work_that_is_allowed() {
        assert_eq!(tried(1000, 48).rounds(), [6, 12, 24, 48]);
        assert_eq!(tried(1000, 3).rounds(), [1, 2, 3]);
        assert_eq!(tried(16, 8).rounds(), [8]);
        for (loops, seeds) in [(1000, 48), (300, 16), (60, 8), (16, 8), (5, 1)] {
            let mut halving = tried(loops, seeds);
            let (rounds, mut random) = (halving.rounds(), StdRng::seed_from_u64(2));
            for (k, &seeds) in rounds.iter().enumerate() {
                for setting in halving.settings(k, &rounds, &mut random).unwrap() {
                    let error = setting[0].unwrap();
                    let trial = Trial { setting, ..trial(k + 1, 1.0, &vec![error; seeds]) };
                    halving.trials.push(trial);
                }
            }
            let made = halving.made();
            assert!(made <= loops && made * 10 >= loops * 6, "{made} of {loops}");
            let least = halving.trials.iter().filter_map(Trial::mean).fold(1.0, f64::min);
            // Means of different numbers of equal values differ by rounding.
            assert!(halving.best().unwrap().mean().unwrap() <= least * (1.0 + 1e-9), "{loops}");
        }
    }

    #[test]
    fn the_best_setting_has_no_failures_before_it_has_a_low_mean() {
        let mut halving = tried(100, 2);
        let best = |halving: &Halving| halving.best().map(|trial| trial.setting[0].unwrap());
        assert_eq!(best(&halving), None);
        halving.trials = vec![trial(1, 0.5, &[0.0])];
        halving.trials.push(trial(2, 0.2, &[0.1, f64::NAN]));
        assert_eq!(best(&halving), Some(0.2));
        halving.trials.extend([trial(2, 0.1, &[0.4, 0.4]), trial(2, 0.01, &[0.3, 0.3])]);
        assert_eq!((best(&halving), halving.at_edge()), (Some(0.01), vec!["scale"]));
        halving.trials.push(trial(2, 0.9, &[0.1, 0.1]));
        assert_eq!((best(&halving), halving.at_edge()), (Some(0.9), vec!["scale"]));
        halving.trials.push(trial(2, 0.3, &[0.0, 0.1]));
        assert!(halving.at_edge().is_empty());
    }

    #[test]
    fn training_seeds_are_not_scored_on() {
        let training = [TRAINING_SEED, TRAINING_SEED + 1];
        assert!(check_held_out(&training, &[0, 1, 2]).is_ok());
        assert!(check_held_out(&training, &[TRAINING_SEED - 1, TRAINING_SEED]).is_err());
    }
}
