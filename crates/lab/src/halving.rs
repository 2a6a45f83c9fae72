//! A search by successive halving: many settings on a few seeds, the better half of them on twice as many, and so on.
//!
//! Half of the work of a round goes to settings near the best of the round before. Source: Jamieson and Talwalkar 2016 for the halving;
//! what is near the best is not in it.

use std::cmp::Ordering;

use anyhow::Context;
use rand::{Rng, SeedableRng, rngs::StdRng};
use serde_json::{Map, Value, json};

use crate::{
    Error, Experiment, Partial, Run, Runner,
    evaluate::was_interrupted,
    format::{exact, line, short, short_or_none},
    mean, mean_interval,
    plot::{Axis, Mark, Plot, Series},
    report::{Report, Table},
};

/// First of the seeds that settings are compared on, far from those that they are scored on.
pub const TRAINING_SEED: u64 = 1_000_000;

/// Seed of the settings that are drawn.
const DRAWN: u64 = 7;
/// Rounds at most; each has half the seeds of the next.
const ROUNDS: u32 = 4;
/// A setting near another has each number up to this factor, as a logarithm, away from its.
const NEAR: f64 = 0.5;
/// How often it has a flag that the other leaves out, or the other way round.
const OTHERWISE: f64 = 0.15;
/// Draws before it is given up that none is valid.
const DRAWS: usize = 1000;
/// The best lies at an end of a range if it is nearer than this share of it.
const EDGE: f64 = 0.03;
/// Settings in the table of a page.
const SHOWN: usize = 24;

/// The settings among which a search looks.
#[derive(Clone, Debug)]
pub struct SearchSpace {
    /// The axes.
    pub axes: Vec<SearchAxis>,
    /// Whether there is such a setting.
    pub valid: fn(&Setting) -> bool,
}

/// What is tried for a flag.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchAxis {
    /// The flag without dashes, such as `scale-end`.
    pub flag: &'static str,
    /// Least and largest value, positive; none if the flag is always left out.
    pub range: Option<[f64; 2]>,
    /// Whether half of the settings leave it out.
    pub optional: bool,
}

/// The value of every axis; none where its flag is left out.
pub type Setting = Vec<Option<f64>>;

/// A setting and how it did on the training seeds.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The setting.
    pub setting: Setting,
    /// The last round that it was in, from 1 on.
    round: usize,
    /// The score of what each seed returned; none where the numbers did not stay finite.
    scores: Vec<Option<f64>>,
    /// How many runs succeeded.
    successes: usize,
    /// Wall time of the runs.
    seconds: f64,
}

/// A search and what it found.
#[derive(Clone, Debug)]
pub struct Halving {
    /// The flags of the best setting, with all that they need.
    pub best_flags: String,
    /// The score of what runs of it on other seeds returned.
    pub held_out: Vec<f64>,
    space: SearchSpace,
    /// Name and unit.
    score: [&'static str; 2],
    /// Training seeds.
    seeds: Vec<u64>,
    /// Runs that it may make.
    loops: usize,
    /// What it has tried so far.
    trials: Vec<Trial>,
    /// Whether the user stopped it.
    stopped: bool,
}

const CRITERION: &str = "lowest mean of the score of what is returned over the training seeds, among the settings of the last round with \
                         the fewest runs whose numbers stop being finite";

impl SearchSpace {
    fn draw(&self, random: &mut StdRng) -> Option<Setting> {
        (0..DRAWS)
            .map(|_| self.axes.iter().map(|axis| axis.draw(random)).collect())
            .find(self.valid)
    }

    fn near(&self, setting: &Setting, random: &mut StdRng) -> Option<Setting> {
        let near = |random: &mut StdRng| -> Setting {
            let axes = self.axes.iter().zip(setting);
            axes.map(|(axis, value)| axis.near(*value, random)).collect()
        };
        (0..DRAWS).map(|_| near(random)).find(self.valid)
    }

    /// Whether more than one setting can be drawn.
    pub fn is_free(&self) -> bool {
        let is_free =
            |axis: &SearchAxis| axis.range.is_some_and(|[low, high]| axis.optional || low < high);
        self.axes.iter().any(is_free)
    }

    /// The flags that ask for a setting.
    pub fn flags(&self, setting: &Setting) -> String {
        let flag = |(axis, value): (&SearchAxis, &Option<f64>)| {
            value.map(|value| format!("--{} {}", axis.flag, exact(value)))
        };
        self.axes.iter().zip(setting).filter_map(flag).collect::<Vec<_>>().join(" ")
    }
}

impl SearchAxis {
    /// One that has values between the least and the largest of a list.
    pub fn among(flag: &'static str, values: &[f64]) -> Self {
        let [low, high] = values
            .iter()
            .fold([f64::INFINITY, 0.0], |[low, high], &x| [f64::min(low, x), f64::max(high, x)]);
        Self { flag, range: (low <= high).then_some([low, high]), optional: false }
    }

    fn draw(&self, random: &mut StdRng) -> Option<f64> {
        let [low, high] = self.range?;
        let (out, part) = (random.random::<bool>(), random.random::<f64>());
        (!(out && self.optional)).then(|| self.clamped(low * (high / low).powf(part)))
    }

    fn near(&self, value: Option<f64>, random: &mut StdRng) -> Option<f64> {
        let (otherwise, step) = (random.random::<f64>(), random.random::<f64>());
        match value {
            Some(value) if !(self.optional && otherwise < OTHERWISE) => {
                Some(self.clamped(value * (NEAR * (2.0 * step - 1.0)).exp()))
            }
            None if self.optional && otherwise < OTHERWISE => self.draw(random),
            _ => None,
        }
    }

    /// The nearest value in the range, to three digits unless it is an end.
    fn clamped(&self, value: f64) -> f64 {
        self.range.map_or(value, |[low, high]| rounded(value).clamp(low, high))
    }
}

/// To three digits, so that a value found can be typed.
pub fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
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

    /// What is known of it, in the order of the columns of a table.
    fn fields(&self, space: &SearchSpace) -> Vec<(String, Value)> {
        let mut fields = vec![("round".into(), self.round.into())];
        let values = space.axes.iter().zip(&self.setting);
        fields.extend(values.map(|(axis, value)| (axis.flag.replace('-', "_"), json!(value))));
        let runs = self.scores.len();
        let rate = self.successes as f64 / runs.max(1) as f64;
        fields.extend([
            ("mean".into(), json!(self.mean())),
            ("n".into(), (runs - self.broken()).into()),
            ("non_finite".into(), self.broken().into()),
            ("success_rate".into(), rate.into()),
            ("seconds".into(), self.seconds.into()),
        ]);
        fields
    }

    fn json(&self, space: &SearchSpace) -> Value {
        let mut json = Map::from_iter(self.fields(space));
        json.insert("per_run".into(), json!(self.scores));
        json.into()
    }
}

/// Makes the experiment of a setting.
pub type MakeSetting<'a> = dyn FnMut(&Setting) -> anyhow::Result<Box<dyn Experiment>> + 'a;

impl Halving {
    /// One that has not tried anything yet, and may make `loops` runs; `score` has a name and a unit.
    pub fn new(
        space: SearchSpace,
        score: [&'static str; 2],
        seeds: Vec<u64>,
        loops: usize,
    ) -> Self {
        let (best_flags, held_out, trials) = (String::new(), Vec::new(), Vec::new());
        Self { best_flags, held_out, space, score, seeds, loops, trials, stopped: false }
    }

    /// Goes through all rounds, until the user stops it, and returns the best setting.
    ///
    /// `each` are the steps of a run, `later` those of all runs that follow the search, for the progress bar.
    ///
    /// # Errors
    ///
    /// Those of the experiments and of the cache; if no setting is valid or gave finite numbers; [`Error::Interrupted`] if none has yet.
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

    /// Seeds of each round.
    fn rounds(&self) -> Vec<usize> {
        let mut rounds: Vec<usize> =
            (0..ROUNDS).rev().map(|k| self.seeds.len().div_ceil(1 << k)).collect();
        rounds.dedup();
        // As many rounds as there is work for.
        while rounds.len() > 1 && self.loops < 2 * rounds.len() * rounds[rounds.len() - 1] {
            rounds.remove(0);
        }
        rounds
    }

    /// The settings of a round: those that are kept of the one before it, and others near them.
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

    fn trial(
        &self,
        runner: &mut Runner,
        setting: &Setting,
        [round, seeds]: [usize; 2],
        label: &str,
        make: &mut MakeSetting<'_>,
    ) -> anyhow::Result<Trial> {
        let experiment = make(setting)?;
        let returned = |run: &Run, score| run.returned(score).map(|point| point.values[score]);
        let seeds = &self.seeds[..seeds];
        let (scores, tried) = runner.score(experiment.as_ref(), seeds, label, returned)?;
        let successes = tried.runs.iter().filter(|run| run.success).count();
        Ok(Trial { setting: setting.clone(), round, scores, successes, seconds: tried.seconds })
    }

    /// Runs that it has made. Those of an earlier round are not made again.
    fn made(&self) -> usize {
        self.trials.iter().map(|trial| trial.scores.len() - self.earlier(trial)).sum()
    }

    /// Runs of the same setting in earlier rounds.
    fn earlier(&self, trial: &Trial) -> usize {
        let same = self.trials.iter().filter(|one| one.setting == trial.setting);
        same.filter(|one| one.round < trial.round).map(|one| one.scores.len()).max().unwrap_or(0)
    }

    /// How many runs are made, of how many that it may make, where the user stopped it.
    pub fn partial(&self) -> Option<Partial> {
        self.stopped.then(|| self.done())
    }

    /// The same, stopped or not.
    pub fn done(&self) -> Partial {
        Partial { finished: self.made(), asked: self.loops }
    }

    fn best(&self) -> Option<&Trial> {
        let last = self.trials.iter().map(|trial| trial.round).max()?;
        let finite =
            self.trials.iter().filter(|trial| trial.round == last && trial.mean().is_some());
        finite.min_by(|a, b| better_first(a, b))
    }

    /// The flags, without dashes, whose best value lies at an end of its range.
    fn at_edge(&self) -> Vec<&'static str> {
        let Some(best) = self.best() else { return Vec::new() };
        let edge = |(axis, value): (&SearchAxis, &Option<f64>)| {
            let ([low, high], value) = (axis.range?, (*value)?);
            let part = (value / low).ln() / (high / low).ln();
            (low < high && !(EDGE..=1.0 - EDGE).contains(&part)).then_some(axis.flag)
        };
        self.space.axes.iter().zip(&best.setting).filter_map(edge).collect()
    }

    /// What the user should know.
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

    /// As it stands in `search.json`.
    pub fn json(&self) -> Value {
        let held_out = (!self.held_out.is_empty()).then(|| {
            let (values, ends) = (&self.held_out, mean_interval(&self.held_out));
            json!({ "runs": values.len(), "mean": mean(values), "ci95": ends })
        });
        let mut best = self.best().map_or(Value::Null, |trial| trial.json(&self.space));
        best["flags"] = self.best_flags.as_str().into();
        json!({
            "score": { "name": self.score[0], "unit": self.score[1] },
            "criterion": CRITERION,
            "training_seed": self.seeds[0],
            "training_runs": self.seeds.len(),
            "loops": self.made(),
            "partial": self.partial(),
            "best": best,
            "held_out": held_out,
            "seconds": self.trials.iter().map(|trial| trial.seconds).sum::<f64>(),
            "warnings": self.warnings(),
            "trials": self.trials.iter().map(|trial| trial.json(&self.space)).collect::<Vec<_>>(),
        })
    }

    /// All trials as CSV, one row each: `round`, a column for every axis, `mean,n,non_finite,success_rate,seconds`; what has no value
    /// is empty.
    pub fn csv(&self) -> String {
        let text = |value: &Value| match value {
            Value::Null => String::new(),
            number => number.as_f64().map_or_else(|| number.to_string(), exact),
        };
        let rows = self.trials.iter().map(|trial| trial.fields(&self.space));
        let (mut head, mut body) = (Vec::new(), String::new());
        for row in rows {
            let values: Vec<String> = row.iter().map(|(_, value)| text(value)).collect();
            body += &format!("{}\n", values.join(","));
            head = row.into_iter().map(|(name, _)| name).collect();
        }
        format!("{}\n{body}", head.join(","))
    }

    fn head(&self) -> String {
        let settings = self.trials.iter().filter(|trial| self.earlier(trial) == 0).count();
        let (first, last) = (self.seeds[0], self.seeds[self.seeds.len() - 1]);
        let seconds: f64 = self.trials.iter().map(|trial| trial.seconds).sum();
        format!(
            "{settings} settings in {} runs on the training seeds {first} to {last}, the better ones on more of them, {seconds:.1} s",
            self.made()
        )
    }

    fn best_score(&self) -> String {
        let mean = short_or_none(self.best().and_then(Trial::mean));
        format!("{} {mean} on the training seeds", self.score[0])
    }

    /// A few lines for people.
    pub fn text(&self) -> Vec<String> {
        let mut lines = vec![line("searched", &self.head())];
        lines.extend(self.partial().map(|partial| line("stopped", &partial.of("runs"))));
        lines.extend([line("best", &self.best_flags), line("", &self.best_score())]);
        lines
    }

    /// What was tried and what is best, as a section of a page.
    ///
    /// # Errors
    ///
    /// If a chart cannot be drawn.
    pub fn section(&self, report: &mut Report) -> anyhow::Result<()> {
        report.heading("Search");
        report.paragraph(&format!("{}. The best setting:", self.head()));
        report.code(&self.best_flags);
        report.paragraph(&format!("It has {}.", self.best_score()));
        if !self.held_out.is_empty() {
            let [low, high] = mean_interval(&self.held_out).map(short);
            report.paragraph(&format!(
                "On {} seeds that the search never saw it is {} (95 % interval {low} to {high}); all results below are of these.",
                self.held_out.len(),
                short(mean(&self.held_out))
            ));
        }
        for axis in 0..self.space.axes.len() {
            if let Some(plot) = self.chart(axis) {
                report.chart(&plot.svg()?, "");
            }
        }
        report.table(&self.table());
        report.note(&format!(
            "Mean {} of what is returned on the training seeds. The {SHOWN} settings that came farthest, the best first; search.csv has \
             all. The best has the {CRITERION}. A star marks settings with runs whose numbers did not stay finite.",
            self.score[0]
        ));
        Ok(())
    }

    /// Score against the values of an axis that is searched, a colour for each round.
    fn chart(&self, axis: usize) -> Option<Plot> {
        let SearchAxis { flag, range, .. } = &self.space.axes[axis];
        range.filter(|[low, high]| low < high)?;
        let score = Axis::logarithmic(&format!("{} returned", self.score[0]));
        let mut plot = Plot::new(Axis::logarithmic(flag), score);
        for round in 1..=self.rounds().len() {
            let of_round = self.trials.iter().filter(|trial| trial.round == round);
            let points = of_round.filter_map(|trial| Some([trial.setting[axis]?, trial.mean()?]));
            let mut name = format!("round {round}");
            for point in points {
                let (name, mark) = (std::mem::take(&mut name), Mark::Dot);
                let colour = ROUND_COLOURS[(round - 1) % ROUND_COLOURS.len()];
                plot.series.push(Series {
                    name,
                    colour,
                    points: vec![point],
                    mark,
                    ..Series::default()
                });
            }
        }
        (!plot.series.is_empty()).then_some(plot)
    }

    fn table(&self) -> Table {
        let mut trials: Vec<&Trial> = self.trials.iter().collect();
        trials.sort_by(|a, b| b.round.cmp(&a.round).then(better_first(a, b)));
        let mut settings: Vec<&Setting> = Vec::new();
        trials.retain(|trial| {
            let new = !settings.contains(&&trial.setting);
            settings.push(&trial.setting);
            new
        });
        let axes = self.space.axes.iter().map(|axis| axis.flag);
        let mut table =
            Table::new(["seeds"].into_iter().chain(axes).chain([self.score[0]]).map(str::to_owned));
        let named = |value: &Option<f64>| value.map_or_else(|| "-".into(), exact);
        for (k, trial) in trials.into_iter().take(SHOWN).enumerate() {
            let star = if trial.broken() > 0 { " *" } else { "" };
            let mean = format!("{}{star}", short_or_none(trial.mean()));
            let values = trial.setting.iter().map(named);
            table.push([trial.scores.len().to_string()].into_iter().chain(values).chain([mean]));
            if k == 0 {
                table.choose_last();
            }
        }
        table
    }
}

/// From light to dark.
const ROUND_COLOURS: [[u8; 3]; 4] =
    [[200, 205, 210], [130, 180, 220], [31, 96, 168], [196, 84, 24]];

/// Fewer runs that went wrong, then a lower mean.
fn better_first(a: &Trial, b: &Trial) -> Ordering {
    let mean = |trial: &Trial| trial.mean().unwrap_or(f64::INFINITY);
    a.broken().cmp(&b.broken()).then(mean(a).total_cmp(&mean(b)))
}

/// Refuses held-out seeds that are trained on.
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
    use super::*;

    fn space() -> SearchSpace {
        let optional = |axis| SearchAxis { optional: true, ..axis };
        let axes = vec![
            SearchAxis::among("scale", &[1.0, 0.01]),
            optional(SearchAxis::among("scale-end", &[0.01, 1.0])),
            SearchAxis::among("rate", &[0.3]),
            SearchAxis::among("none", &[]),
        ];
        SearchSpace { axes, valid: |setting| setting[1].is_none() || setting[1] < setting[0] }
    }

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
    fn settings_are_valid_and_lie_in_their_ranges() {
        let (space, mut random) = (space(), StdRng::seed_from_u64(1));
        let mut now = space.draw(&mut random).unwrap();
        let (mut moving, mut wide) = (0, 0);
        for k in 0..400 {
            now = match k % 2 {
                0 => space.near(&now, &mut random).unwrap(),
                _ => space.draw(&mut random).unwrap(),
            };
            assert!((space.valid)(&now) && (now[2], now[3]) == (Some(0.3), None), "{now:?}");
            assert!((0.01..=1.0).contains(&now[0].unwrap()), "{now:?}");
            moving += usize::from(now[1].is_some());
            wide += usize::from(now[0] > Some(0.1));
        }
        assert!((80..320).contains(&moving) && (120..320).contains(&wide), "{moving} {wide}");
        assert!(space.is_free());
        let setting = vec![Some(1.0), Some(1e-7), None, None];
        assert_eq!(space.flags(&setting), "--scale 1 --scale-end 1e-7");
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
            // Means of more or fewer equal numbers differ by rounding.
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
