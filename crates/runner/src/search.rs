use std::time::Instant;

use anyhow::Context;
use serde::{Deserialize, Serialize};

use crate::{
    Batch, Error, Score, Settings, Task,
    job::{Part, Worker, first_not_finite, was_interrupted},
    mean,
    prepared::Prepared,
    quantity::Quantity,
    space::{Setting, Space},
};

/// First of the seeds that settings are compared on, far from those they are scored on: a search
/// with `n` training seeds takes this one and the `n - 1` that follow.
pub(crate) const TRAINING_SEED: u64 = 1_000_000;

/// A setting and how it did on the training seeds.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Cell {
    pub(crate) grid: Stage,
    #[serde(flatten)]
    pub(crate) setting: Setting,
    /// Of the score at the last step, over the runs whose numbers stayed finite.
    pub(crate) mean: Option<f64>,
    /// Runs whose numbers stayed finite, and those whose did not.
    pub(crate) n: usize,
    pub(crate) non_finite: usize,
    /// Over all runs.
    pub(crate) success_rate: f64,
    /// In the order of the seeds; none where the numbers did not stay finite.
    pub(crate) per_run: Vec<Option<f64>>,
    /// Wall time of the runs.
    pub(crate) seconds: f64,
}

/// The grid that a cell is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Stage {
    Coarse,
    Fine,
}

/// What becomes of one setting, as a journal keeps it.
#[derive(Serialize, Deserialize)]
struct Trials {
    seconds: f64,
    /// Of each seed the score as text, which keeps all its digits, and the success.
    runs: Vec<(Option<String>, bool)>,
}

/// A search for the best setting.
pub(crate) struct Search<'a, T: Task> {
    pub(crate) settings: &'a Settings,
    pub(crate) args: &'a T::Args,
    pub(crate) space: &'a Space,
    pub(crate) score: Score,
    /// Training seeds.
    pub(crate) seeds: &'a [u64],
    /// Steps of one run.
    pub(crate) steps: usize,
    /// Steps of all runs that follow the search, for the progress bar.
    pub(crate) later: usize,
}

/// The cell with the fewest runs that went wrong, and of these the one with the lowest mean.
pub(crate) fn best(cells: &[Cell]) -> Option<&Cell> {
    let finite = cells.iter().filter(|cell| cell.mean.is_some());
    finite.min_by(|a, b| {
        let rank = |cell: &Cell| (cell.non_finite, cell.mean.unwrap_or(f64::INFINITY));
        let ((a_bad, a), (b_bad, b)) = (rank(a), rank(b));
        a_bad.cmp(&b_bad).then(a.total_cmp(&b))
    })
}

impl<T: Task> Search<'_, T> {
    /// Tries the coarse grid and the fine one around its best; says whether that was cut short.
    ///
    /// # Errors
    ///
    /// Those of the task and of the journal, and if no setting gave finite numbers.
    pub(crate) fn cells(&self, worker: &mut Worker) -> anyhow::Result<(Vec<Cell>, bool)> {
        let mut cells = Vec::new();
        for stage in [Stage::Coarse, Stage::Fine] {
            let each = self.steps * self.seeds.len();
            worker.progress.expect(self.expected(&cells) * each + self.later);
            let settings = match stage {
                Stage::Coarse => self.space.coarse(),
                Stage::Fine => self.fine(&cells).context(
                    "the numbers stop being finite with every setting: try a smaller \
                     --learning-rates",
                )?,
            };
            if self.try_all(worker, stage, &settings, &mut cells)? {
                return Ok((cells, true));
            }
        }
        Ok((cells, false))
    }

    /// How many settings there are in all; the most that there may be before the coarse grid is
    /// finished, because the fine one depends on its best.
    pub(crate) fn expected(&self, cells: &[Cell]) -> usize {
        let coarse = self.space.coarse();
        let fine = match cells.len() < coarse.len() {
            true => coarse.iter().map(|&best| self.space.fine(best, &coarse).len()).max(),
            false => self.fine(&cells[..coarse.len()]).map(|fine| fine.len()),
        };
        coarse.len() + fine.unwrap_or(0)
    }

    fn fine(&self, coarse: &[Cell]) -> Option<Vec<Setting>> {
        let tried: Vec<Setting> = coarse.iter().map(|cell| cell.setting).collect();
        best(coarse).map(|best| self.space.fine(best.setting, &tried))
    }

    /// Adds a cell for every setting; true if the user stopped that.
    fn try_all(
        &self,
        worker: &mut Worker,
        stage: Stage,
        settings: &[Setting],
        cells: &mut Vec<Cell>,
    ) -> anyhow::Result<bool> {
        for (k, &setting) in settings.iter().enumerate() {
            let name = if stage == Stage::Coarse { "coarse" } else { "fine" };
            let label = format!("{name} grid, setting {} of {}", k + 1, settings.len());
            match self.cell(worker, stage, setting, label) {
                Ok(cell) => cells.push(cell),
                Err(stopped) if was_interrupted(&stopped) => return Ok(true),
                Err(failed) => {
                    let first = self.seeds[0];
                    return Err(failed).with_context(|| {
                        format!("training seeds from {first} on with {}", setting.flags())
                    });
                }
            }
        }
        Ok(false)
    }

    fn cell(
        &self,
        worker: &mut Worker,
        stage: Stage,
        setting: Setting,
        label: String,
    ) -> anyhow::Result<Cell> {
        let mut settings = setting.apply(self.settings);
        (settings.seed, settings.runs) = (self.seeds[0], Some(self.seeds.len()));
        let prepared = Prepared::<T>::new(settings, self.args)?;
        let score = Quantity::score(&prepared.description, self.score);
        let (mut seconds, mut runs) = (0.0, Vec::new());
        for seeds in self.seeds.chunks(prepared.batch_size()) {
            let part = Part {
                name: format!(
                    "{}, seeds {} to {}",
                    setting.flags(),
                    seeds[0],
                    seeds[seeds.len() - 1]
                ),
                label: label.clone(),
                runs: seeds.len(),
                steps: prepared.description.steps,
            };
            let batch = Batch { seeds: seeds.to_vec(), pictures: false };
            let trials = worker.part(part, |progress| {
                let clock = Instant::now();
                let runs = crate::job::solve(&prepared, &batch, progress)?.runs;
                let runs = runs.iter().map(|run| {
                    let last = &run.curve[run.curve.len() - 1];
                    let finite = first_not_finite(run).is_none();
                    (finite.then(|| score.of(last).to_string()), run.success && finite)
                });
                Ok(Trials { runs: runs.collect(), seconds: clock.elapsed().as_secs_f64() })
            })?;
            seconds += trials.seconds;
            runs.extend(trials.runs);
        }
        let number = |text: &Option<String>| text.as_ref().map(|text| text.parse()).transpose();
        let per_run: Vec<Option<f64>> = runs
            .iter()
            .map(|(score, _)| number(score))
            .collect::<Result<_, _>>()
            .context("a score in the journal cannot be read: leave out --resume")?;
        let finite: Vec<f64> = per_run.iter().copied().flatten().collect();
        Ok(Cell {
            grid: stage,
            setting,
            mean: (!finite.is_empty()).then(|| mean(&finite)),
            n: finite.len(),
            non_finite: per_run.len() - finite.len(),
            success_rate: runs.iter().filter(|(_, success)| *success).count() as f64
                / runs.len() as f64,
            per_run,
            seconds,
        })
    }
}

/// Refuses held-out seeds that the search trains on.
///
/// # Errors
///
/// [`Error::Usage`] that names the training seeds.
pub(crate) fn check_held_out(training: &[u64], held_out: &[u64]) -> Result<(), Error> {
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

    fn cell(scale: f64, mean: Option<f64>, non_finite: usize) -> Cell {
        Cell {
            grid: Stage::Coarse,
            setting: Setting {
                scale: Some(scale),
                scale_end: None,
                learning_rate: None,
                own: None,
            },
            mean,
            n: 4 - non_finite,
            non_finite,
            success_rate: 0.0,
            per_run: Vec::new(),
            seconds: 0.0,
        }
    }

    #[test]
    fn the_best_cell_has_no_failures_before_it_has_a_low_mean() {
        let cells = [cell(1.0, Some(0.1), 1), cell(2.0, Some(0.4), 0), cell(3.0, Some(0.3), 0)];
        assert_eq!(best(&cells).unwrap().setting.scale, Some(3.0));
        assert_eq!(best(&cells[..1]).unwrap().setting.scale, Some(1.0));
        assert!(best(&[cell(1.0, None, 4)]).is_none());
    }

    #[test]
    fn training_seeds_are_not_scored_on() {
        let training = [TRAINING_SEED, TRAINING_SEED + 1];
        assert!(check_held_out(&training, &[0, 1, 2]).is_ok());
        assert!(check_held_out(&training, &[TRAINING_SEED - 1, TRAINING_SEED]).is_err());
    }
}
