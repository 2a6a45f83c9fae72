use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::{
    Batch, Run, Settings, Task, best_step,
    job::{Part, Worker, first_not_finite, solve},
    ladder::{Rung, With},
    mean,
    prepared::Prepared,
    quantity::Quantity,
};

/// An answer to a question of `choose`, and how it did on the training seeds.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub(crate) flags: String,
    pub(crate) settings: Settings,
    /// What it computes with, such as `2 parameters`.
    pub(crate) with: String,
    /// Error of what each seed returns; none where it is not finite.
    pub(crate) errors: Vec<Option<f64>>,
    /// Time of the optimisation steps of one run.
    pub(crate) seconds: f64,
    /// Time that the trial took, with all that judges it.
    pub(crate) wall: f64,
}

/// What becomes of some runs, as a journal keeps it.
#[derive(Serialize, Deserialize)]
struct Tried {
    seconds: f64,
    wall: f64,
    /// As text, which keeps all its digits.
    errors: Vec<Option<String>>,
}

impl Trial {
    /// Solves `seeds` with a task that was prepared as `rung` says.
    ///
    /// `before` are the flags of the answers to earlier questions, which tell parts of a journal apart.
    ///
    /// # Errors
    ///
    /// Those of the task and of the journal.
    pub(crate) fn new<T: Task>(
        rung: Rung,
        prepared: &Prepared<T>,
        before: &str,
        seeds: &[u64],
        worker: &mut Worker,
    ) -> anyhow::Result<Self> {
        let score = Quantity::score(&prepared.description, prepared.task.score());
        let with = said(&rung.with, prepared);
        let (mut errors, mut seconds, mut wall) = (Vec::new(), 0.0, 0.0);
        for seeds in seeds.chunks(prepared.batch_size()) {
            let part = Part {
                name: format!("{before} {}, seeds from {}", rung.flags, seeds[0]),
                label: rung.flags.clone(),
                runs: seeds.len(),
                steps: prepared.description.steps,
            };
            let batch = Batch { seeds: seeds.to_vec(), pictures: false };
            let tried = worker.part(part, |progress| {
                let clock = Instant::now();
                let runs = solve(prepared, &batch, progress)?.runs;
                // All runs of a batch carry the times of its steps, unless each has been solved by itself.
                let times = runs.iter().map(|run| run.step_seconds.iter().sum::<f64>());
                Ok(Tried {
                    seconds: times.fold(0.0, f64::max),
                    wall: clock.elapsed().as_secs_f64(),
                    errors: runs.iter().map(|run| error(run, score)).collect(),
                })
            })?;
            let number = |text: Option<String>| text.and_then(|text| text.parse().ok());
            errors.extend(tried.errors.into_iter().map(number));
            seconds += tried.seconds;
            wall += tried.wall;
        }
        let Rung { flags, settings, .. } = rung;
        Ok(Self { flags, settings, with, errors, seconds: seconds / seeds.len() as f64, wall })
    }

    /// Another name for the same: what the question started from, which is not tried again.
    pub(crate) fn renamed<T: Task>(&self, rung: Rung, prepared: &Prepared<T>) -> Self {
        let with = said(&rung.with, prepared);
        Self { flags: rung.flags, settings: rung.settings, with, ..self.clone() }
    }

    /// Mean error; none if a run has no finite one.
    pub(crate) fn mean(&self) -> Option<f64> {
        let errors = self.errors.iter().copied().collect::<Option<Vec<f64>>>()?;
        Some(mean(&errors))
    }
}

fn error(run: &Run, score: Quantity) -> Option<String> {
    let finite = first_not_finite(run).is_none();
    let best = best_step(&run.curve, |point| score.of(point));
    best.filter(|_| finite).map(|best| score.of(best).to_string())
}

fn said<T: Task>(with: &With, prepared: &Prepared<T>) -> String {
    match with {
        With::Words(words) => words.clone(),
        With::Faces => format!("{} faces", prepared.description.faces),
        With::Parameters(more) => match prepared.description.parameters + more {
            1 => "1 parameter".into(),
            count => format!("{count} parameters"),
        },
    }
}
