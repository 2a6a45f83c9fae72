use crate::{
    Batch, Run, Task,
    encoded::Encoded,
    job::{Part, Worker, keep_finite, label, solve, was_interrupted},
    prepared::Prepared,
};

/// Solved instances of one method, in the order of the seeds.
#[derive(Default)]
pub(crate) struct Evaluation {
    pub(crate) runs: Vec<Run>,
    /// Of the first run.
    pub(crate) pictures: Option<Encoded>,
    /// Wall time of the runs, with metrics and pictures.
    pub(crate) seconds: f64,
    /// Wall time of the optimisation steps alone.
    pub(crate) step_seconds: f64,
}

/// Solves all seeds with each of the named methods, and says whether that was cut short.
///
/// A batch goes through all methods before the next begins, so that what is finished stays paired.
///
/// # Errors
///
/// Those of the task and of the journal. That the user stops is none, but for a single run.
pub(crate) fn evaluate<T: Task>(
    worker: &mut Worker,
    methods: &[(&str, &Prepared<T>)],
    seeds: &[u64],
) -> anyhow::Result<(Vec<Evaluation>, bool)> {
    let mut evaluations: Vec<_> = methods.iter().map(|_| Evaluation::default()).collect();
    let size = methods.iter().map(|(_, method)| method.batch_size()).min().unwrap_or(1);
    for now in seeds.chunks(size) {
        for ((name, method), evaluation) in methods.iter().zip(&mut evaluations) {
            match batch(worker, name, method, now, evaluation, seeds.len(), methods.len() > 1) {
                Ok(()) => {}
                Err(stopped) if was_interrupted(&stopped) && seeds.len() > 1 => {
                    return Ok((evaluations, true));
                }
                Err(failed) => return Err(failed),
            }
        }
    }
    Ok((evaluations, false))
}

fn batch<T: Task>(
    worker: &mut Worker,
    name: &str,
    method: &Prepared<T>,
    seeds: &[u64],
    evaluation: &mut Evaluation,
    all: usize,
    named: bool,
) -> anyhow::Result<()> {
    let (first, last) = (evaluation.runs.len() + 1, evaluation.runs.len() + seeds.len());
    let mut shown = label(first, last, all);
    if named {
        shown = format!("{}, {shown}", method.description.softness);
    }
    let part = Part {
        name: format!("{name}, seeds {} to {}", seeds[0], seeds[seeds.len() - 1]),
        label: shown,
        runs: seeds.len(),
        steps: method.description.steps,
    };
    let batch = Batch { seeds: seeds.to_vec(), pictures: first == 1 };
    let solved = worker.part(part, |progress| {
        let mut solved = solve(method, &batch, progress)?;
        solved.runs.iter_mut().try_for_each(keep_finite)?;
        Ok(solved)
    })?;
    // All runs of a batch carry the times of its steps.
    evaluation.step_seconds += solved.runs.first().map_or(0.0, |run| run.step_seconds.iter().sum());
    evaluation.runs.extend(solved.runs);
    evaluation.seconds += solved.seconds;
    evaluation.pictures = evaluation.pictures.take().or(solved.pictures);
    Ok(())
}
