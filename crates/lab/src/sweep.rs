use anyhow::Context;
use serde_json::{Map, Value, json};

use crate::{
    Error, Experiment, Partial, Run, Runner,
    evaluate::was_interrupted,
    format::{exact, line, short, short_or_none},
    mean, mean_interval, quantile,
    report::{Report, Table},
};

/// First of the seeds that settings are compared on, far from those that they are scored on.
pub const TRAINING_SEED: u64 = 1_000_000;

/// What a grid search tries: every combination of the values of its axes that is valid.
#[derive(Clone, Debug)]
pub struct SearchSpace {
    /// The axes.
    pub axes: Vec<SearchAxis>,
    /// Whether there is such a combination.
    pub valid: fn(&GridPoint) -> bool,
}

/// Values to try for a flag.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchAxis {
    /// The flag without dashes, such as `scale-end`.
    pub flag: &'static str,
    /// Values, ascending and positive; none is the flag left out.
    pub values: Vec<Option<f64>>,
}

/// The value of every axis.
pub type GridPoint = Vec<Option<f64>>;

/// A grid point and how it did on the training seeds.
#[derive(Clone, Debug)]
pub struct GridResult {
    /// The values.
    pub point: GridPoint,
    /// Whether it is of the fine grid.
    fine: bool,
    /// The score of each seed at the last step; none where the numbers did not stay finite.
    scores: Vec<Option<f64>>,
    /// How many runs succeeded.
    successes: usize,
    /// Wall time of the runs.
    seconds: f64,
}

/// A grid search and what it found.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The flags of the best cell, with all that they need.
    pub best_flags: String,
    /// The score of the best at the last step of runs on other seeds.
    pub held_out: Vec<f64>,
    space: SearchSpace,
    /// Name and unit.
    score: [&'static str; 2],
    /// Training seeds.
    seeds: Vec<u64>,
    /// What it has tried so far.
    cells: Vec<GridResult>,
    /// Whether the user stopped it.
    stopped: bool,
}

const CRITERION: &str = "lowest mean of the score over the training seeds, at the last step, among the settings with the fewest \
                         runs whose numbers stop being finite";

impl SearchSpace {
    /// The coarse grid.
    pub fn coarse(&self) -> Vec<GridPoint> {
        self.product(self.axes.iter().map(|axis| axis.values.clone()))
    }

    /// The fine grid around a point of the coarse one, without what was tried before.
    fn fine(&self, best: &GridPoint, tried: &[GridPoint]) -> Vec<GridPoint> {
        let mut all =
            self.product(self.axes.iter().zip(best).map(|(axis, best)| axis.around(*best)));
        all.retain(|point| !tried.contains(point));
        all
    }

    fn product(&self, choices: impl Iterator<Item = Vec<Option<f64>>>) -> Vec<GridPoint> {
        let mut all = vec![Vec::new()];
        for values in choices {
            let longer = |point: GridPoint| {
                values.iter().map(move |value| [&point[..], &[*value]].concat()).collect::<Vec<_>>()
            };
            all = all.into_iter().flat_map(longer).collect();
        }
        all.retain(self.valid);
        all
    }

    /// The flags that ask for a point.
    pub fn flags(&self, point: &GridPoint) -> String {
        let flag = |(axis, value): (&SearchAxis, &Option<f64>)| {
            value.map(|value| format!("--{} {}", axis.flag, exact(value)))
        };
        self.axes.iter().zip(point).filter_map(flag).collect::<Vec<_>>().join(" ")
    }
}

impl SearchAxis {
    /// One of its values, and those halfway to its neighbours in the logarithm; beyond the first and the last the axis goes on as on
    /// the other side.
    fn around(&self, best: Option<f64>) -> Vec<Option<f64>> {
        let near = |best: f64| {
            let coarse: Vec<f64> = self.values.iter().copied().flatten().collect();
            let at = coarse.iter().position(|&x| x == best)?;
            let up = coarse.get(at + 1).map(|next| next / best);
            let down = at.checked_sub(1).map(|before| best / coarse[before]);
            let (below, above) = (best / down.or(up)?.sqrt(), best * up.or(down)?.sqrt());
            Some(vec![Some(rounded(below)), Some(best), Some(rounded(above))])
        };
        best.and_then(near).unwrap_or_else(|| vec![best])
    }
}

/// To three digits, so that a value found can be typed.
pub fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

impl GridResult {
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
        let mut fields = vec![("grid".into(), if self.fine { "fine" } else { "coarse" }.into())];
        let values = space.axes.iter().zip(&self.point);
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

/// The cell with the fewest runs that went wrong, and of these the one with the lowest mean.
fn best<'a>(cells: impl Iterator<Item = &'a GridResult>) -> Option<&'a GridResult> {
    let finite = cells.filter_map(|cell| Some((cell, cell.broken(), cell.mean()?)));
    let best = finite.min_by(|(_, a_bad, a), (_, b_bad, b)| a_bad.cmp(b_bad).then(a.total_cmp(b)));
    best.map(|(cell, ..)| cell)
}

/// Makes the experiment of a grid point.
pub type MakePoint<'a> = dyn FnMut(&GridPoint) -> anyhow::Result<Box<dyn Experiment>> + 'a;

impl Sweep {
    /// One that has not tried anything yet; `score` has a name and a unit.
    pub fn new(space: SearchSpace, score: [&'static str; 2], seeds: Vec<u64>) -> Self {
        let (best_flags, held_out, cells) = (String::new(), Vec::new(), Vec::new());
        Self { best_flags, held_out, space, score, seeds, cells, stopped: false }
    }

    /// Tries the coarse grid and the fine one around its best, until it is through or the user stops it, and returns the best cell.
    ///
    /// `each` are the steps of a run, `later` those of all runs that follow the search, for the progress bar.
    ///
    /// # Errors
    ///
    /// Those of the experiments and of the cache; if no point gave finite numbers; [`Error::Interrupted`] if none has yet.
    pub fn run(
        &mut self,
        runner: &mut Runner,
        [each, later]: [usize; 2],
        make: &mut MakePoint<'_>,
    ) -> anyhow::Result<&GridResult> {
        for fine in [false, true] {
            runner.progress.expect(self.done().asked * each * self.seeds.len() + later);
            let points = if fine { self.fine_points()? } else { self.space.coarse() };
            for (k, point) in points.iter().enumerate() {
                let grid = if fine { "fine" } else { "coarse" };
                let label = format!("{grid} grid, setting {} of {}", k + 1, points.len());
                match self.cell(runner, point, fine, &label, make) {
                    Ok(cell) => self.cells.push(cell),
                    Err(stopped) if was_interrupted(&stopped) => {
                        self.stopped = true;
                        return self.best().ok_or(stopped);
                    }
                    Err(failed) => {
                        let flags = self.space.flags(point);
                        let seed = self.seeds[0];
                        let context = format!("training seeds from {seed} on with {flags}");
                        return Err(failed.context(context));
                    }
                }
            }
        }
        self.best().context("the coarse grid has a best point")
    }

    fn cell(
        &self,
        runner: &mut Runner,
        point: &GridPoint,
        fine: bool,
        label: &str,
        make: &mut MakePoint<'_>,
    ) -> anyhow::Result<GridResult> {
        let experiment = make(point)?;
        let last = |run: &Run, score: usize| run.curve.last().map(|point| point.values[score]);
        let (scores, tried) = runner.score(experiment.as_ref(), &self.seeds, label, last)?;
        let successes = tried.runs.iter().filter(|run| run.success).count();
        Ok(GridResult { point: point.clone(), fine, scores, successes, seconds: tried.seconds })
    }

    /// The fine grid around the best of the coarse one.
    fn fine_points(&self) -> anyhow::Result<Vec<GridPoint>> {
        let coarse = self.cells.iter().filter(|cell| !cell.fine);
        let best = best(coarse.clone()).context(
            "the numbers stop being finite with every setting: try a smaller --learning-rates",
        )?;
        let tried: Vec<GridPoint> = coarse.map(|cell| cell.point.clone()).collect();
        Ok(self.space.fine(&best.point, &tried))
    }

    /// How many points are tried, of how many in all: the most that there may be before the coarse grid is finished, because the fine
    /// one depends on its best.
    pub fn done(&self) -> Partial {
        let coarse = self.space.coarse();
        let fine = match self.cells.len() < coarse.len() {
            true => coarse.iter().map(|best| self.space.fine(best, &coarse).len()).max(),
            false => self.fine_points().ok().map(|fine| fine.len()),
        };
        Partial { finished: self.cells.len(), asked: coarse.len() + fine.unwrap_or(0) }
    }

    /// The same, where the user stopped it.
    pub fn partial(&self) -> Option<Partial> {
        self.stopped.then(|| self.done())
    }

    fn best(&self) -> Option<&GridResult> {
        best(self.cells.iter())
    }

    /// The flags, without dashes, whose best value is the smallest or largest of several that were tried.
    fn at_edge(&self) -> Vec<&'static str> {
        let Some(best) = self.best() else { return Vec::new() };
        let edge = |(k, axis): (usize, &SearchAxis)| {
            let tried = || self.cells.iter().filter_map(|cell| cell.point[k]);
            let ends = [tried().fold(f64::INFINITY, f64::min), tried().fold(0.0, f64::max)];
            let several = axis.values.iter().flatten().count() > 1;
            (several && best.point[k].is_some_and(|x| ends.contains(&x))).then_some(axis.flag)
        };
        self.space.axes.iter().enumerate().filter_map(edge).collect()
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
        let mut best = self.best().map_or(Value::Null, |cell| cell.json(&self.space));
        best["flags"] = self.best_flags.as_str().into();
        json!({
            "score": { "name": self.score[0], "unit": self.score[1] },
            "criterion": CRITERION,
            "training_seed": self.seeds[0],
            "training_runs": self.seeds.len(),
            "partial": self.partial(),
            "best": best,
            "held_out": held_out,
            "seconds": self.cells.iter().map(|cell| cell.seconds).sum::<f64>(),
            "warnings": self.warnings(),
            "cells": self.cells.iter().map(|cell| cell.json(&self.space)).collect::<Vec<_>>(),
        })
    }

    /// All cells as CSV, one row each: `grid`, a column for every axis, `mean,n,non_finite,success_rate,seconds`; what has no value is
    /// empty.
    pub fn csv(&self) -> String {
        let text = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) => text.clone(),
            number => number.as_f64().map_or_else(|| number.to_string(), exact),
        };
        let rows = self.cells.iter().map(|cell| cell.fields(&self.space));
        let (mut head, mut body) = (Vec::new(), String::new());
        for row in rows {
            let values: Vec<String> = row.iter().map(|(_, value)| text(value)).collect();
            body += &format!("{}\n", values.join(","));
            head = row.into_iter().map(|(name, _)| name).collect();
        }
        format!("{}\n{body}", head.join(","))
    }

    fn head(&self) -> String {
        let fine = self.cells.iter().filter(|cell| cell.fine).count();
        let coarse = self.cells.len() - fine;
        let (first, last) = (self.seeds[0], self.seeds[self.seeds.len() - 1]);
        let seconds: f64 = self.cells.iter().map(|cell| cell.seconds).sum();
        format!(
            "{coarse} settings of a coarse grid and {fine} of a fine one, each on the training seeds {first} to {last}, {seconds:.1} s"
        )
    }

    fn best_score(&self) -> String {
        let mean = short_or_none(self.best().and_then(GridResult::mean));
        format!("{} {mean} on the training seeds", self.score[0])
    }

    /// A few lines for people.
    pub fn text(&self) -> Vec<String> {
        let mut lines = vec![line("searched", &self.head())];
        lines.extend(self.partial().map(|partial| line("stopped", &partial.of("settings"))));
        lines.extend([line("best", &self.best_flags), line("", &self.best_score())]);
        lines
    }

    /// What was tried and what is best, as a section of a page; the columns of its table are the values of the axis `across`.
    pub fn section(&self, report: &mut Report, across: &str) {
        let score = self.score[0];
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
        report.table(&self.table(across));
        report.note(&format!(
            "Mean {score} on the training seeds at the last step, by {across} from left to right: the lower (darker) the better. The \
             best is bold: it has the {CRITERION}. A star marks settings with runs whose numbers did not stay finite."
        ));
    }

    fn table(&self, across: &str) -> Table {
        let axis = self.space.axes.iter().position(|axis| axis.flag == across);
        let key = |cell: &GridResult| axis.and_then(|k| cell.point[k]);
        let mut columns: Vec<Option<f64>> = self.cells.iter().map(key).collect();
        columns.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        columns.dedup();
        let row = |cell: &GridResult| -> GridPoint {
            let others = cell.point.iter().enumerate().filter(|(k, _)| Some(*k) != axis);
            others.map(|(_, value)| *value).collect()
        };
        let mut rows: Vec<GridPoint> = self.cells.iter().map(row).collect();
        rows.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        rows.dedup();
        let means: Vec<f64> = self.cells.iter().filter_map(GridResult::mean).collect();
        let (low, high) = (quantile(&means, 0.0), quantile(&means, 0.75));
        let chosen = self.best().map(|cell| &cell.point);
        let named = |value: &Option<f64>| value.map_or_else(|| "-".into(), exact);
        let others = self.space.axes.iter().map(|axis| axis.flag).filter(|flag| *flag != across);
        let mut table = Table::new(others.map(str::to_owned).chain(columns.iter().map(named)));
        for values in rows {
            let at = |column: &Option<f64>| {
                self.cells.iter().find(|cell| row(cell) == values && key(cell) == *column)
            };
            let label = |cell: &GridResult| {
                let star = if cell.broken() > 0 { " *" } else { "" };
                let text = format!("{}{star}", short_or_none(cell.mean()));
                if Some(&cell.point) == chosen { format!("**{text}**") } else { text }
            };
            let shade = |cell: &GridResult| {
                Some(((cell.mean()? - low) / (high - low).max(1e-300)).clamp(0.0, 1.0))
            };
            let cells: Vec<Option<&GridResult>> = columns.iter().map(at).collect();
            let text = cells.iter().map(|cell| cell.map(label).unwrap_or_default());
            table.push(values.iter().map(named).chain(text));
            let shades = cells.iter().map(|cell| cell.and_then(shade));
            table.shade_last(values.iter().map(|_| None).chain(shades).collect());
        }
        table
    }
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
        let axis = |flag, values: &[f64]| SearchAxis {
            flag,
            values: values.iter().copied().map(Some).collect(),
        };
        let mut ends = axis("scale-end", &[0.01, 0.1, 1.0]);
        ends.values.insert(0, None);
        let axes = vec![axis("scale", &[0.01, 0.1, 1.0]), ends, axis("rate", &[0.1, 1.0])];
        SearchSpace { axes, valid: |point| point[1].is_none() || point[1] < point[0] }
    }

    fn tried(cells: &[(f64, [f64; 2])]) -> Sweep {
        let cell = |&(scale, scores): &(f64, [f64; 2])| {
            let scores = scores.map(|x| Some(x).filter(|x| x.is_finite())).to_vec();
            let point = vec![Some(scale), None, Some(1.0)];
            GridResult { fine: false, point, scores, successes: 0, seconds: 1.0 }
        };
        let mut sweep = Sweep::new(space(), ["error", ""], vec![TRAINING_SEED]);
        sweep.cells = cells.iter().map(cell).collect();
        sweep
    }

    #[test]
    fn the_coarse_grid_has_every_valid_combination() {
        let coarse = space().coarse();
        assert_eq!(coarse.len(), (3 + 3) * 2);
        assert_eq!(space().flags(&vec![Some(1.0), Some(1e-7), None]), "--scale 1 --scale-end 1e-7");
    }

    #[test]
    fn the_fine_grid_surrounds_the_best_and_repeats_nothing() {
        let (space, coarse) = (space(), space().coarse());
        let fine = space.fine(&vec![Some(0.1), None, Some(1.0)], &coarse);
        assert_eq!(fine.len(), 3 * 3 - 1);
        assert!(fine.iter().all(|point| point[1].is_none()));
        let fine = space.fine(&vec![Some(0.1), Some(0.01), Some(1.0)], &coarse);
        assert!(fine.iter().all(|point| point[1] < point[0]) && fine.len() == 3 * 8 - 1);
    }

    #[test]
    fn values_lie_between_the_neighbours_and_go_on_beyond_an_end() {
        let around = |coarse: &[f64], best| {
            let values = coarse.iter().copied().map(Some).collect();
            let found = SearchAxis { flag: "x", values }.around(Some(best));
            found.into_iter().flatten().collect::<Vec<_>>()
        };
        let coarse = [0.01, 0.1, 10.0];
        assert_eq!(around(&coarse, 0.1), [0.0316, 0.1, 1.0]);
        assert_eq!(around(&coarse, 10.0), [1.0, 10.0, 100.0]);
        assert_eq!(around(&[0.5], 0.5), [0.5]);
    }

    #[test]
    fn the_best_cell_has_no_failures_before_it_has_a_low_mean() {
        let cells = [(1.0, [0.1, f64::NAN]), (0.1, [0.4, 0.4]), (0.01, [0.3, 0.3])];
        let best = |cells| tried(cells).best().map(|cell| cell.point[0].unwrap());
        assert_eq!((best(&cells), best(&cells[..1])), (Some(0.01), Some(1.0)));
        assert_eq!(best(&[(1.0, [f64::NAN; 2])]), None);
        assert_eq!(tried(&cells).at_edge(), ["scale", "rate"]);
        assert_eq!(tried(&[cells[0], cells[1], (0.01, [0.5; 2])]).at_edge(), ["rate"]);
    }

    #[test]
    fn training_seeds_are_not_scored_on() {
        let training = [TRAINING_SEED, TRAINING_SEED + 1];
        assert!(check_held_out(&training, &[0, 1, 2]).is_ok());
        assert!(check_held_out(&training, &[TRAINING_SEED - 1, TRAINING_SEED]).is_err());
    }
}
