use anyhow::Context;
use serde_json::{Map, Value, json};

use crate::{
    Error, Experiment, Partial, Role, Run, Runner,
    evaluate::was_interrupted,
    format::{exact, short, short_or_none},
    mean, mean_interval, place, quantile,
    report::{Report, Table},
};

/// First of the seeds that settings are compared on, far from those that they are scored on.
pub const TRAINING_SEED: u64 = 1_000_000;

/// What a grid search tries: every combination of the values of its axes that is valid.
#[derive(Clone, Debug)]
pub struct SearchSpace {
    /// The axes.
    pub axes: Vec<Axis>,
    /// Values of the fine grid between the best value and each of its neighbours, evenly spaced in the logarithm.
    pub between: usize,
    /// Whether there is such a combination.
    pub valid: fn(&GridPoint) -> bool,
}

/// Values to try for a flag.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The flag without dashes, such as `scale-end`.
    pub flag: &'static str,
    /// Values, ascending and positive; none is the flag left out.
    pub values: Vec<Option<f64>>,
}

/// The value of every axis.
pub type GridPoint = Vec<Option<f64>>;

/// A grid point and how it did on the training seeds.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Whether it is of the fine grid.
    pub fine: bool,
    /// The values.
    pub point: GridPoint,
    /// The score of each seed at the last step; none where the numbers did not stay finite.
    pub scores: Vec<Option<f64>>,
    /// How many runs succeeded.
    pub successes: usize,
    /// Wall time of the runs.
    pub seconds: f64,
}

/// What a search found.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// What it could try.
    pub space: SearchSpace,
    /// What it tried; one of them has finite numbers at least.
    pub cells: Vec<Cell>,
    /// The flags of the best cell, with all that they need.
    pub best_flags: String,
    /// Name and unit of the score.
    pub score: [&'static str; 2],
    /// First of the seeds, and how many they are.
    pub seeds: [u64; 2],
    /// There where the user stopped it.
    pub partial: Option<Partial>,
    /// The score of the best at the last step of runs on other seeds.
    pub held_out: Vec<f64>,
}

const CRITERION: &str = "lowest mean of the score over the training seeds, at the last step, among the settings with the fewest \
                         runs whose numbers stop being finite";

impl SearchSpace {
    /// The coarse grid.
    pub fn coarse(&self) -> Vec<GridPoint> {
        self.product(&self.axes.iter().map(|axis| axis.values.clone()).collect::<Vec<_>>())
    }

    /// The fine grid around a point of the coarse one, without what was tried before.
    pub fn fine(&self, best: &GridPoint, tried: &[GridPoint]) -> Vec<GridPoint> {
        let around = |(axis, best): (&Axis, &Option<f64>)| match best {
            Some(best) => between(axis, *best, self.between),
            None => vec![None],
        };
        let mut all = self.product(&self.axes.iter().zip(best).map(around).collect::<Vec<_>>());
        all.retain(|point| !tried.contains(point));
        all
    }

    fn product(&self, choices: &[Vec<Option<f64>>]) -> Vec<GridPoint> {
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
        let flag = |(axis, value): (&Axis, &Option<f64>)| {
            value.map(|value| format!("--{} {}", axis.flag, exact(value)))
        };
        self.axes.iter().zip(point).filter_map(flag).collect::<Vec<_>>().join(" ")
    }

    /// The flags, without dashes, whose best value is the smallest or largest of several that were tried.
    fn at_edge(&self, best: &GridPoint, cells: &[Cell]) -> Vec<&'static str> {
        let edge = |(k, axis): (usize, &Axis)| {
            let tried = || cells.iter().filter_map(|cell| cell.point[k]);
            let ends = [tried().fold(f64::INFINITY, f64::min), tried().fold(0.0, f64::max)];
            let several = axis.values.iter().flatten().count() > 1;
            (several && best[k].is_some_and(|x| ends.contains(&x))).then_some(axis.flag)
        };
        self.axes.iter().enumerate().filter_map(edge).collect()
    }
}

/// Values around `best`, one of those of the axis and itself among them; beyond the first and the last they go on as on the other
/// side.
fn between(axis: &Axis, best: f64, between: usize) -> Vec<Option<f64>> {
    let coarse: Vec<f64> = axis.values.iter().copied().flatten().collect();
    let at = coarse.iter().position(|&x| x == best);
    let ratio =
        |low: Option<usize>, high: Option<usize>| Some(coarse.get(high?)? / coarse.get(low?)?);
    let up = ratio(at, at.map(|k| k + 1));
    let down = ratio(at.and_then(|k| k.checked_sub(1)), at);
    let (Some(up), Some(down)) = (up.or(down), down.or(up)) else {
        return vec![Some(best)];
    };
    let steps = between as i32 + 1;
    let part = |ratio: f64, k: i32| rounded(best * ratio.powf(f64::from(k) / f64::from(steps)));
    let below = (1..steps).rev().map(|k| part(down, -k));
    let above = (1..steps).map(|k| part(up, k));
    below.chain([best]).chain(above).map(Some).collect()
}

/// To three digits, so that a value found can be typed.
pub fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

impl Cell {
    /// Mean score over the runs that stayed finite.
    pub fn mean(&self) -> Option<f64> {
        let finite: Vec<f64> = self.scores.iter().copied().flatten().collect();
        (!finite.is_empty()).then(|| mean(&finite))
    }

    fn broken(&self) -> usize {
        self.scores.iter().filter(|score| score.is_none()).count()
    }

    fn json(&self, space: &SearchSpace) -> Value {
        let mut json = Map::new();
        json.insert("grid".into(), if self.fine { "fine" } else { "coarse" }.into());
        for (axis, value) in space.axes.iter().zip(&self.point) {
            json.insert(axis.flag.replace('-', "_"), json!(value));
        }
        json.insert("mean".into(), json!(self.mean()));
        json.insert("n".into(), (self.scores.len() - self.broken()).into());
        json.insert("non_finite".into(), self.broken().into());
        let rate = self.successes as f64 / self.scores.len().max(1) as f64;
        json.insert("success_rate".into(), rate.into());
        json.insert("per_run".into(), json!(self.scores));
        json.insert("seconds".into(), self.seconds.into());
        json.into()
    }
}

/// The cell with the fewest runs that went wrong, and of these the one with the lowest mean.
pub fn best(cells: &[Cell]) -> Option<&Cell> {
    let finite = cells.iter().filter_map(|cell| Some((cell, cell.broken(), cell.mean()?)));
    let best = finite.min_by(|(_, a_bad, a), (_, b_bad, b)| a_bad.cmp(b_bad).then(a.total_cmp(b)));
    best.map(|(cell, ..)| cell)
}

/// Makes the experiment of a grid point.
pub type MakePoint<'a> = dyn FnMut(&GridPoint) -> anyhow::Result<Box<dyn Experiment>> + 'a;

impl Runner {
    /// Tries the coarse grid and the fine one around its best on `seeds`, and says whether the user cut that short.
    ///
    /// `each` are the steps of a run, `later` those of all runs that follow the search, for the progress bar.
    ///
    /// # Errors
    ///
    /// Those of the experiments and of the cache, and if no point gave finite numbers.
    pub fn sweep(
        &mut self,
        space: &SearchSpace,
        seeds: &[u64],
        [each, later]: [usize; 2],
        make: &mut MakePoint<'_>,
    ) -> anyhow::Result<(Vec<Cell>, bool)> {
        let mut cells = Vec::new();
        for fine in [false, true] {
            self.progress.expect(expected(space, &cells) * each * seeds.len() + later);
            let points = if fine { fine_points(space, &cells)? } else { space.coarse() };
            for (k, point) in points.iter().enumerate() {
                let grid = if fine { "fine" } else { "coarse" };
                let label = format!("{grid} grid, setting {} of {}", k + 1, points.len());
                match self.cell(point, seeds, &label, make) {
                    Ok(cell) => cells.push(Cell { fine, ..cell }),
                    Err(stopped) if was_interrupted(&stopped) => return Ok((cells, true)),
                    Err(failed) => {
                        let flags = space.flags(point);
                        return Err(failed).with_context(|| {
                            format!("training seeds from {} on with {flags}", seeds[0])
                        });
                    }
                }
            }
        }
        Ok((cells, false))
    }

    fn cell(
        &mut self,
        point: &GridPoint,
        seeds: &[u64],
        label: &str,
        make: &mut MakePoint<'_>,
    ) -> anyhow::Result<Cell> {
        let experiment = make(point)?;
        let (evaluations, stopped) =
            self.evaluate(&[experiment.as_ref()], seeds, false, Some(label))?;
        if stopped {
            return Err(Error::Interrupted.into());
        }
        let (runs, seconds) = (&evaluations[0].runs, evaluations[0].seconds);
        let score = place(experiment.metrics(), Role::Score);
        let last =
            |run: &Run| Some(run.curve.last()?.values[score]).filter(|_| run.broke_at.is_none());
        let successes = runs.iter().filter(|run| run.success).count();
        let (point, scores) = (point.clone(), runs.iter().map(last).collect());
        Ok(Cell { fine: false, point, scores, successes, seconds })
    }
}

fn fine_points(space: &SearchSpace, cells: &[Cell]) -> anyhow::Result<Vec<GridPoint>> {
    let best = best(cells).context(
        "the numbers stop being finite with every setting: try a smaller --learning-rates",
    )?;
    let tried: Vec<GridPoint> = cells.iter().map(|cell| cell.point.clone()).collect();
    Ok(space.fine(&best.point, &tried))
}

/// How many points there are in all; the most that there may be before the coarse grid is finished, because the fine one depends on
/// its best.
pub fn expected(space: &SearchSpace, cells: &[Cell]) -> usize {
    let coarse = space.coarse();
    let fine = match cells.len() < coarse.len() {
        true => coarse.iter().map(|best| space.fine(best, &coarse).len()).max(),
        false => fine_points(space, &cells[..coarse.len()]).ok().map(|fine| fine.len()),
    };
    coarse.len() + fine.unwrap_or(0)
}

impl Sweep {
    /// What the user should know.
    pub fn warnings(&self) -> Vec<String> {
        let best = best(&self.cells).filter(|_| self.partial.is_none());
        let edges = best.map(|best| self.space.at_edge(&best.point, &self.cells));
        let warning = |flag: &str| {
            format!(
                "the best --{flag} lies at the edge of what was tried, and may lie beyond: give --scales, --learning-rates or the \
                 flag itself"
            )
        };
        edges.unwrap_or_default().into_iter().map(warning).collect()
    }

    /// As it stands in `search.json`.
    pub fn json(&self) -> Value {
        let [seed, runs] = self.seeds;
        let held_out = (!self.held_out.is_empty()).then(|| {
            let (values, ends) = (&self.held_out, mean_interval(&self.held_out));
            json!({ "runs": values.len(), "mean": mean(values), "ci95": ends })
        });
        let mut best = best(&self.cells).map_or(Value::Null, |cell| cell.json(&self.space));
        best["flags"] = self.best_flags.as_str().into();
        json!({
            "score": { "name": self.score[0], "unit": self.score[1] },
            "criterion": CRITERION,
            "training_seed": seed,
            "training_runs": runs,
            "partial": self.partial,
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
        let columns = self.space.axes.iter().map(|axis| axis.flag.replace('-', "_"));
        let columns: Vec<String> = ["grid".to_owned()].into_iter().chain(columns).collect();
        let end = ["mean", "n", "non_finite", "success_rate", "seconds"];
        let mut text = format!("{},{}\n", columns.join(","), end.join(","));
        for cell in &self.cells {
            let json = cell.json(&self.space);
            let field = |name: &str| match &json[name] {
                Value::Null => String::new(),
                Value::String(text) => text.clone(),
                number => number.as_f64().map_or_else(|| number.to_string(), exact),
            };
            let fields: Vec<String> =
                columns.iter().map(|c| field(c)).chain(end.map(field)).collect();
            text += &format!("{}\n", fields.join(","));
        }
        text
    }

    fn head(&self) -> String {
        let fine = self.cells.iter().filter(|cell| cell.fine).count();
        let ([first, runs], coarse) = (self.seeds, self.cells.len() - fine);
        let seconds: f64 = self.cells.iter().map(|cell| cell.seconds).sum();
        format!(
            "{coarse} settings of a coarse grid and {fine} of a fine one, each on the training seeds {first} to {}, {seconds:.1} s",
            first + runs - 1
        )
    }

    fn best_mean(&self) -> String {
        short_or_none(best(&self.cells).and_then(Cell::mean))
    }

    /// A few lines for people.
    pub fn text(&self) -> Vec<String> {
        let line = |name: &str, text: String| format!("  {name:<22} {text}");
        let mut lines = vec![line("searched", self.head())];
        lines.extend(self.partial.map(|partial| line("stopped", partial.of("settings"))));
        lines.push(line("best", self.best_flags.clone()));
        lines.push(line(
            "",
            format!("{} {} on the training seeds", self.score[0], self.best_mean()),
        ));
        lines
    }

    /// What was tried and what is best, as a section of a page; the columns of its table are the values of the axis `across`.
    pub fn section(&self, report: &mut Report, across: &str) {
        let score = self.score[0];
        report.heading("Search");
        report.paragraph(&format!("{}. The best setting:", self.head()));
        report.code(&self.best_flags);
        report.paragraph(&format!("Its {score} is {} on the training seeds.", self.best_mean()));
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
        let key = |cell: &Cell| axis.and_then(|k| cell.point[k]);
        let mut columns: Vec<Option<f64>> = self.cells.iter().map(key).collect();
        columns.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        columns.dedup();
        let row = |cell: &Cell| -> GridPoint {
            let others = cell.point.iter().enumerate().filter(|(k, _)| Some(*k) != axis);
            others.map(|(_, value)| *value).collect()
        };
        let mut rows: Vec<GridPoint> = self.cells.iter().map(row).collect();
        rows.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        rows.dedup();
        let means: Vec<f64> = self.cells.iter().filter_map(Cell::mean).collect();
        let (low, high) = (quantile(&means, 0.0), quantile(&means, 0.75));
        let chosen = best(&self.cells).map(|cell| cell.point.clone());
        let named = |value: &Option<f64>| value.map_or_else(|| "-".into(), exact);
        let others = self.space.axes.iter().map(|axis| axis.flag).filter(|flag| *flag != across);
        let mut table = Table::new(others.map(str::to_owned).chain(columns.iter().map(named)));
        for values in rows {
            let at = |column: &Option<f64>| {
                self.cells.iter().find(|cell| row(cell) == values && key(cell) == *column)
            };
            let label = |cell: &Cell| {
                let star = if cell.broken() > 0 { " *" } else { "" };
                let text = format!("{}{star}", short_or_none(cell.mean()));
                if Some(&cell.point) == chosen.as_ref() { format!("**{text}**") } else { text }
            };
            let shade = |cell: &Cell| {
                Some(((cell.mean()? - low) / (high - low).max(1e-300)).clamp(0.0, 1.0))
            };
            let cells: Vec<Option<&Cell>> = columns.iter().map(at).collect();
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
        let axis = |flag, values: &[f64]| Axis {
            flag,
            values: values.iter().copied().map(Some).collect(),
        };
        let mut ends = axis("scale-end", &[0.01, 0.1, 1.0]);
        ends.values.insert(0, None);
        let axes = vec![axis("scale", &[0.01, 0.1, 1.0]), ends, axis("rate", &[0.1, 1.0])];
        SearchSpace { axes, between: 1, valid: |point| point[1].is_none() || point[1] < point[0] }
    }

    fn cell(point: GridPoint, scores: &[f64]) -> Cell {
        let scores = scores.iter().map(|&x| Some(x).filter(|x| x.is_finite())).collect();
        Cell { fine: false, point, scores, successes: 0, seconds: 1.0 }
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
        let around = |coarse: &[f64], best, n| {
            let values = coarse.iter().copied().map(Some).collect();
            let found = between(&Axis { flag: "x", values }, best, n);
            found.into_iter().flatten().collect::<Vec<_>>()
        };
        let coarse = [0.01, 0.1, 10.0];
        assert_eq!(around(&coarse, 0.1, 1), [0.0316, 0.1, 1.0]);
        assert_eq!(around(&coarse, 10.0, 1), [1.0, 10.0, 100.0]);
        assert_eq!(around(&[1e-3, 1.0, 1e3], 1.0, 2), [0.01, 0.1, 1.0, 10.0, 100.0]);
        assert_eq!((around(&[0.5], 0.5, 2), around(&coarse, 0.1, 0)), (vec![0.5], vec![0.1]));
    }

    #[test]
    fn the_best_cell_has_no_failures_before_it_has_a_low_mean() {
        let point = |x| vec![Some(x), None, Some(1.0)];
        let cells = [
            cell(point(1.0), &[0.1, f64::NAN]),
            cell(point(0.1), &[0.4, 0.4]),
            cell(point(0.01), &[0.3, 0.3]),
        ];
        assert_eq!(best(&cells).unwrap().point, point(0.01));
        assert_eq!(best(&cells[..1]).unwrap().point, point(1.0));
        assert!(best(&[cell(point(1.0), &[f64::NAN])]).is_none());
        assert_eq!(space().at_edge(&point(0.01), &cells), ["scale", "rate"]);
        assert_eq!(space().at_edge(&point(0.1), &cells), ["rate"]);
    }

    #[test]
    fn training_seeds_are_not_scored_on() {
        let training = [TRAINING_SEED, TRAINING_SEED + 1];
        assert!(check_held_out(&training, &[0, 1, 2]).is_ok());
        assert!(check_held_out(&training, &[TRAINING_SEED - 1, TRAINING_SEED]).is_err());
    }
}
