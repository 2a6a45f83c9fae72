use std::time::Instant;

use anyhow::ensure;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    Batch, Description, Error, Progress, Run, Task, encoded::Encoded, journal::Journal,
    prepared::Prepared, stored,
};

/// Does the parts of a job one after the other, and recalls those that an earlier call has done.
pub(crate) struct Worker {
    pub(crate) progress: Progress,
    /// None for a job that is not worth keeping half done.
    pub(crate) journal: Option<Journal>,
}

/// What to do next.
pub(crate) struct Part {
    /// Its name in the journal, unique in the job.
    pub(crate) name: String,
    /// Its name beside the progress bar.
    pub(crate) label: String,
    /// Runs, and the steps that each makes.
    pub(crate) runs: usize,
    pub(crate) steps: usize,
}

impl Worker {
    /// The result of a part, from the journal or by doing it.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`] if the user has asked the program to stop; those of the journal and
    /// of the work.
    pub(crate) fn part<R: Serialize + DeserializeOwned>(
        &mut self,
        part: Part,
        work: impl FnOnce(&mut Progress) -> anyhow::Result<R>,
    ) -> anyhow::Result<R> {
        let Part { name, label, runs, steps } = part;
        if let Some(journal) = &mut self.journal
            && let Some(result) = journal.recall(&name)?
        {
            self.progress.skip(runs, steps);
            return Ok(result);
        }
        self.progress.begin(label, runs, steps)?;
        let result = work(&mut self.progress)?;
        self.progress.end();
        if let Some(journal) = &mut self.journal {
            journal.record(&name, &result)?;
        }
        Ok(result)
    }

    /// Parts that are finished and kept.
    pub(crate) fn kept(&self) -> usize {
        self.journal.as_ref().map_or(0, Journal::parts)
    }
}

/// The part that an error ended was stopped by the user.
pub(crate) fn was_interrupted(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(Error::Interrupted))
}

/// Some solved instances.
#[derive(Serialize, Deserialize)]
pub(crate) struct Solved {
    /// Wall time of all of them together.
    pub(crate) seconds: f64,
    #[serde(with = "stored")]
    pub(crate) runs: Vec<Run>,
    /// Of the first, if they were asked for.
    pub(crate) pictures: Option<Encoded>,
}

/// Solves one batch.
///
/// # Errors
///
/// Those of [`Task::run`] and of the encoders of pictures.
///
/// # Panics
///
/// If the task breaks its contract.
pub(crate) fn solve<T: Task>(
    prepared: &Prepared<T>,
    batch: &Batch,
    progress: &mut Progress,
) -> anyhow::Result<Solved> {
    let clock = Instant::now();
    let mut runs = prepared.task.run(batch, progress)?;
    assert!(
        runs.iter().map(|run| run.seed).eq(batch.seeds.iter().copied()),
        "a task must return one run per seed, in the order of the seeds"
    );
    for run in &runs {
        assert!(!run.curve.is_empty(), "a run must tell its state before the first step");
        let expected = prepared.description.extra.len();
        for found in run.curve.iter().map(|point| point.extra.len()) {
            assert_eq!(found, expected, "a point must bring all further errors");
        }
    }
    let pictures = Encoded::take(&mut runs)?;
    Ok(Solved { seconds: clock.elapsed().as_secs_f64(), runs, pictures })
}

/// Place in the curve of the first point that is not finite.
pub(crate) fn first_not_finite(run: &Run) -> Option<usize> {
    run.curve.iter().position(|p| {
        let numbers = [p.loss, p.image_error, p.parameter_error, p.scale];
        !numbers.iter().chain(&p.extra).all(|x| x.is_finite())
    })
}

/// Ends the curve before the first point that is not finite; that run is no success.
///
/// # Errors
///
/// If there is nothing before it.
pub(crate) fn keep_finite(run: &mut Run) -> anyhow::Result<()> {
    let Some(bad) = first_not_finite(run) else {
        return Ok(());
    };
    ensure!(
        bad > 0,
        "seed {}: the errors are not finite numbers before the first step: check that the target \
         is in view and that the scale is not extreme",
        run.seed
    );
    run.warnings.push(format!(
        "seed {}: the numbers stop being finite at step {}, so its results end before: try a smaller \
         --learning-rate or a larger --scale",
        run.seed, run.curve[bad].step
    ));
    run.curve.truncate(bad);
    run.success = false;
    Ok(())
}

/// Name of runs `first` to `last` of `all` beside the progress bar.
pub(crate) fn label(first: usize, last: usize, all: usize) -> String {
    match (first, last) {
        (1, 1) if all == 1 => "solving".into(),
        _ if first == last => format!("run {first} of {all}"),
        _ => format!("runs {first}-{last} of {all}"),
    }
}

/// Steps of all runs together.
pub(crate) fn steps(description: &Description, runs: usize) -> usize {
    runs * description.steps
}
