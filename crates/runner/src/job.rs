use crate::{Batch, Description, Progress, Run, Task};

/// Solves all seeds in batches; only the first run keeps its pictures.
pub(crate) fn solve_all<T: Task>(
    task: &T,
    description: &Description,
    seeds: &[u64],
    progress: &mut Progress,
) -> anyhow::Result<Vec<Run>> {
    let mut runs = Vec::with_capacity(seeds.len());
    for (k, seeds_now) in seeds.chunks(task.batch_size().max(1)).enumerate() {
        let (first, last) = (runs.len() + 1, runs.len() + seeds_now.len());
        progress.start(label(first, last, seeds.len()), k * description.steps);
        let batch = Batch { seeds: seeds_now.to_vec(), pictures: k == 0 };
        let solved = task.run(&batch, progress)?;
        assert!(
            solved.iter().map(|run| run.seed).eq(seeds_now.iter().copied()),
            "a task must return one run per seed, in the order of the seeds"
        );
        for mut run in solved {
            keep_finite(&mut run, description)?;
            if !runs.is_empty() {
                run.pictures = None;
            }
            runs.push(run);
        }
    }
    Ok(runs)
}

fn label(first: usize, last: usize, all: usize) -> String {
    match (first, last) {
        (1, 1) if all == 1 => "solving".into(),
        _ if first == last => format!("run {first} of {all}"),
        _ => format!("runs {first}-{last} of {all}"),
    }
}

/// Ends the curve before the first point that is not finite; that run is no success.
fn keep_finite(run: &mut Run, description: &Description) -> anyhow::Result<()> {
    assert!(!run.curve.is_empty(), "a run must tell its state before the first step");
    for point in &run.curve {
        let (found, expected) = (point.extra.len(), description.extra.len());
        assert_eq!(found, expected, "a point must bring all further errors");
    }
    let bad = run.curve.iter().position(|p| {
        let numbers = [p.loss, p.image_error, p.parameter_error, p.scale];
        !numbers.iter().chain(&p.extra).all(|x| x.is_finite())
    });
    match bad {
        None => {}
        Some(0) => anyhow::bail!(
            "seed {}: the errors are not finite numbers before the first step: check that the \
             target is in view and that the scale is not extreme",
            run.seed
        ),
        Some(bad) => {
            run.warnings.push(format!(
                "seed {}: the numbers stop being finite at step {}, so its results end before: try \
                 a smaller --learning-rate or a larger --scale",
                run.seed, run.curve[bad].step
            ));
            run.curve.truncate(bad);
            run.success = false;
        }
    }
    Ok(())
}
