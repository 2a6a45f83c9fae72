use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::{
    Batch, Error, Schedule, Settings, SoftnessChoice, Task, best_step,
    job::{Part, Worker, first_not_finite, solve},
    mean,
    prepared::Prepared,
    quantity::Quantity,
};

/// Methods from the least complex one on: parameters of the family first, then whether the scale
/// moves.
///
/// Source: Wu et al. 2024, Table 1, for the numbers of parameters.
const LADDER: [(&str, Schedule); 10] = [
    ("logistic", Schedule::Static),
    ("gauss", Schedule::Static),
    ("logistic", Schedule::Decay),
    ("gauss", Schedule::Decay),
    ("exp", Schedule::Static),
    ("exp", Schedule::Decay),
    ("gamma", Schedule::Static),
    ("gamma", Schedule::Decay),
    ("mlp", Schedule::Static),
    ("mlp", Schedule::Decay),
];

/// A method and how it did on the training seeds.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Rung {
    /// Name of the softness.
    pub(crate) softness: &'static str,
    /// Whether the scale moves.
    pub(crate) schedule: &'static str,
    /// Parameters of the softness, and one more for an end of the scale.
    pub(crate) parameters: usize,
    /// Error of what each seed returns; none where it is not finite.
    pub(crate) errors: Vec<Option<f64>>,
    /// Wall time of one run.
    pub(crate) seconds: f64,
}

/// What becomes of a rung, as a journal keeps it.
#[derive(Serialize, Deserialize)]
struct Tried {
    seconds: f64,
    /// As text, which keeps all its digits.
    errors: Vec<Option<String>>,
}

/// Settings with this rung's softness and schedule, at the scales of the task.
pub(crate) fn with(settings: &Settings, softness: &'static str, schedule: Schedule) -> Settings {
    Settings {
        softness: Some(SoftnessChoice::Named(softness)),
        schedule: Some(schedule),
        scale: None,
        scale_end: None,
        ..settings.clone()
    }
}

/// Tries the methods of the ladder on `seeds`, for as long as `budget` seconds last, but the first
/// one always; says whether all were tried that the task knows.
///
/// # Errors
///
/// Those of the task and of the journal.
pub(crate) fn climb<T: Task>(
    settings: &Settings,
    args: &T::Args,
    seeds: &[u64],
    budget: Option<f64>,
    worker: &mut Worker,
) -> anyhow::Result<(Vec<Rung>, bool)> {
    let (clock, mut rungs) = (Instant::now(), Vec::new());
    for (softness, schedule) in LADDER {
        let spent = clock.elapsed().as_secs_f64();
        let next = spent * (rungs.len() + 1) as f64 / rungs.len().max(1) as f64;
        if !rungs.is_empty() && budget.is_some_and(|budget| next > budget) {
            return Ok((rungs, false));
        }
        let prepared = match Prepared::<T>::new(with(settings, softness, schedule), args) {
            Ok(prepared) => prepared,
            // A task need not know every family.
            Err(error) if !rungs.is_empty() && is_usage(&error) => continue,
            Err(error) => return Err(error),
        };
        rungs.push(rung(&prepared, softness, schedule, seeds, worker)?);
    }
    Ok((rungs, true))
}

fn is_usage(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(Error::Usage(_)))
}

/// Steps of all runs of the ladder.
pub(crate) fn steps(steps: usize, seeds: usize) -> usize {
    LADDER.len() * steps * seeds
}

fn rung<T: Task>(
    prepared: &Prepared<T>,
    softness: &'static str,
    schedule: Schedule,
    seeds: &[u64],
    worker: &mut Worker,
) -> anyhow::Result<Rung> {
    let moving = schedule == Schedule::Decay;
    let schedule = if moving { "decay" } else { "static" };
    let score = Quantity::score(&prepared.description, prepared.task.score());
    let (mut errors, mut seconds) = (Vec::new(), 0.0);
    for seeds in seeds.chunks(prepared.batch_size()) {
        let part = Part {
            name: format!("{softness} {schedule}, seeds from {}", seeds[0]),
            label: format!("{softness}, {schedule}"),
            runs: seeds.len(),
            steps: prepared.description.steps,
        };
        let batch = Batch { seeds: seeds.to_vec(), pictures: false };
        let tried = worker.part(part, |progress| {
            let clock = Instant::now();
            let runs = solve(prepared, &batch, progress)?.runs;
            let error = |run: &crate::Run| {
                let finite = first_not_finite(run).is_none();
                let best = best_step(&run.curve, |point| score.of(point));
                best.filter(|_| finite).map(|best| score.of(best).to_string())
            };
            let errors = runs.iter().map(error).collect();
            Ok(Tried { seconds: clock.elapsed().as_secs_f64(), errors })
        })?;
        let number = |text: Option<String>| text.and_then(|text| text.parse().ok());
        errors.extend(tried.errors.into_iter().map(number));
        seconds += tried.seconds;
    }
    let parameters = prepared.description.parameters + usize::from(moving);
    Ok(Rung { softness, schedule, parameters, seconds: seconds / seeds.len() as f64, errors })
}

impl Rung {
    /// Mean error; none if a run has no finite one.
    pub(crate) fn mean(&self) -> Option<f64> {
        let errors = self.errors.iter().copied().collect::<Option<Vec<f64>>>()?;
        Some(mean(&errors))
    }
}
