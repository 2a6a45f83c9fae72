use std::{collections::BTreeMap, time::Instant};

use serde::{Deserialize, Serialize};

use crate::{
    Batch, Encoded, Error, Experiment, Progress, Role, Run, Store, mean, place, store::key,
};

/// Runs experiments, and reuses the finished runs of earlier calls.
pub struct Runner {
    /// Progress display.
    pub progress: Progress,
    /// Finished runs.
    pub store: Store<Finished>,
}

/// A finished run, with its pictures if requested.
#[derive(Clone, Serialize, Deserialize)]
pub struct Finished {
    pub(crate) run: Run,
    /// Wall time, with errors and pictures: its share of the batch.
    pub(crate) seconds: f64,
    pub(crate) pictures: Option<Encoded>,
}

/// Finished runs of one experiment, in the order of the seeds.
#[derive(Clone, Default)]
pub struct Evaluation {
    /// The runs.
    pub runs: Vec<Run>,
    /// Pictures of the first run, if requested.
    pub pictures: Option<Encoded>,
    /// Wall time of the runs, with errors and pictures.
    pub seconds: f64,
}

impl Evaluation {
    /// Wall time of the steps of a run, mean over the runs.
    pub fn seconds_per_run(&self) -> f64 {
        mean(&self.runs.iter().map(Run::seconds).collect::<Vec<_>>())
    }
}

impl Runner {
    /// A runner without progress and files, for experiments that run as a library.
    pub fn hidden() -> Self {
        Self { progress: Progress::hidden(), store: Store::in_memory() }
    }

    /// Runs all seeds with each of the experiments, and returns whether the user stopped it early.
    ///
    /// A batch runs with all experiments before the next batch, so that finished runs stay paired. `pictures` requests
    /// those of the first seed. `label` is the text of the progress bar.
    ///
    /// # Errors
    ///
    /// The errors of the experiments and of the store; [`Error::Interrupted`] if a single run was stopped.
    pub fn evaluate(
        &mut self,
        experiments: &[&dyn Experiment],
        seeds: &[u64],
        pictures: bool,
        label: Option<&str>,
    ) -> anyhow::Result<(Vec<Evaluation>, bool)> {
        let mut evaluations: Vec<_> = experiments.iter().map(|_| Evaluation::default()).collect();
        let size = experiments.iter().map(|one| one.batch_size().max(1)).min().unwrap_or(1);
        for (k, now) in seeds.chunks(size).enumerate() {
            for (experiment, evaluation) in experiments.iter().zip(&mut evaluations) {
                let (first, last) = (evaluation.runs.len() + 1, evaluation.runs.len() + now.len());
                let mut prefix = match label {
                    Some(label) => label.to_owned(),
                    None => range(first, last, seeds.len()),
                };
                if experiments.len() > 1 {
                    prefix = format!("{}, {prefix}", experiment.name());
                }
                match self.batch(*experiment, now, pictures && k == 0, prefix) {
                    Ok(finished) => evaluation.extend(finished),
                    Err(stopped) if was_interrupted(&stopped) && seeds.len() > 1 => {
                        return Ok((evaluations, true));
                    }
                    Err(failed) => return Err(failed),
                }
            }
        }
        Ok((evaluations, false))
    }

    /// Runs one experiment on all seeds; the score of each returned step, `None` if the numbers become non-finite. `label` is the text of
    /// the progress bar.
    pub(crate) fn score(
        &mut self,
        experiment: &dyn Experiment,
        seeds: &[u64],
        label: &str,
    ) -> anyhow::Result<(Vec<Option<f64>>, Evaluation)> {
        let (evaluations, stopped) = self.evaluate(&[experiment], seeds, false, Some(label))?;
        if stopped {
            return Err(Error::Interrupted.into());
        }
        let score = place(experiment.metrics(), Role::Score);
        let evaluation = evaluations.into_iter().next().unwrap_or_default();
        let finite = |run: &Run| {
            let returned = run.returned(score).filter(|_| run.broke_at.is_none());
            returned.map(|point| point.values[score])
        };
        Ok((evaluation.runs.iter().map(finite).collect(), evaluation))
    }

    /// Whether the runs of all seeds are finished.
    pub(crate) fn is_finished(&self, experiment: &dyn Experiment, seeds: &[u64]) -> bool {
        let experiment = key(&experiment.identity());
        seeds.iter().all(|&seed| self.store.get(&key_of(&experiment, seed)).is_some())
    }

    /// The runs of some seeds: from the store, or run together.
    pub(crate) fn batch(
        &mut self,
        experiment: &dyn Experiment,
        seeds: &[u64],
        pictures: bool,
        label: String,
    ) -> anyhow::Result<Vec<Finished>> {
        let (kept_as, steps) = (key(&experiment.identity()), experiment.steps());
        let metrics = experiment.metrics().len();
        let mut finished = BTreeMap::new();
        for &seed in seeds {
            let needs_pictures = pictures && seed == seeds[0];
            let suits = |found: &&Finished| {
                found.run.fits(seed, metrics, steps)
                    && (found.pictures.is_some() || !needs_pictures)
            };
            let found = self.store.get(&key_of(&kept_as, seed)).filter(suits);
            finished.extend(found.map(|found| (seed, found.clone())));
        }
        self.progress.skip(finished.len(), steps);
        let missing: Vec<u64> =
            seeds.iter().copied().filter(|seed| !finished.contains_key(seed)).collect();
        if !missing.is_empty() {
            self.progress.begin(label, missing.len(), steps)?;
            let pictures = pictures && missing[0] == seeds[0];
            let made = run(experiment, &Batch { seeds: missing, pictures }, &mut self.progress)?;
            self.progress.end();
            for one in made {
                let key = key_of(&kept_as, one.run.seed);
                self.store.put(&key, experiment.name(), &one)?;
                finished.insert(one.run.seed, one);
            }
        }
        Ok(seeds.iter().filter_map(|seed| finished.remove(seed)).collect())
    }
}

impl Evaluation {
    fn extend(&mut self, finished: Vec<Finished>) {
        for Finished { run, seconds, pictures } in finished {
            self.runs.push(run);
            self.seconds += seconds;
            self.pictures = self.pictures.take().or(pictures);
        }
    }
}

/// The key of a run in the store.
pub(crate) fn key_of(experiment: &str, seed: u64) -> String {
    format!("{experiment}-{seed}")
}

/// Runs one batch.
fn run(
    experiment: &dyn Experiment,
    batch: &Batch,
    progress: &mut Progress,
) -> anyhow::Result<Vec<Finished>> {
    let clock = Instant::now();
    let mut runs = experiment.run(batch, progress)?;
    assert!(
        runs.iter().map(|run| run.seed).eq(batch.seeds.iter().copied()),
        "an experiment must return one run per seed, in the order of the seeds"
    );
    let mut encoded = None;
    for run in &mut runs {
        run.keep_finite();
        let (metrics, steps) = (experiment.metrics().len(), experiment.steps());
        assert!(
            run.fits(run.seed, metrics, steps),
            "a run has a point per step and a value per metric"
        );
        if let Some(pictures) = run.pictures.take() {
            encoded = Some(Encoded::new(&pictures)?);
        }
    }
    let seconds = clock.elapsed().as_secs_f64() / runs.len() as f64;
    let finished = runs.into_iter().map(|run| Finished { run, seconds, pictures: encoded.take() });
    Ok(finished.collect())
}

/// Whether the user stopped the work.
pub fn was_interrupted(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(Error::Interrupted))
}

/// `runs` consecutive seeds from `first`.
pub fn seeds(first: u64, runs: usize) -> Vec<u64> {
    (0..runs as u64).map(|k| first.wrapping_add(k)).collect()
}

pub(crate) fn range(first: usize, last: usize, all: usize) -> String {
    match (first, last) {
        (1, 1) if all == 1 => "solving".into(),
        _ if first == last => format!("run {first} of {all}"),
        _ => format!("runs {first}-{last} of {all}"),
    }
}
