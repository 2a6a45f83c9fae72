use std::{
    fs::{self, OpenOptions},
    io::Write,
    path::Path,
};

use anyhow::Context;
use serde_json::{Value, json};

use super::{Results, ended_learning, out};
use crate::{
    Command, Curve, Figure, Learned, OuterStep, Progress, Study, Task,
    folder::{self, Folder},
    interrupt,
    memory::peak_rss_mib,
    prepared::Prepared,
    report,
    settings::CommandLine,
    summary::short,
};

/// Learns a softness, and writes it with a report.
///
/// Every outer step leaves a line in `learn.jsonl` and then a checkpoint, so that a program that was
/// killed at any moment goes on with `--resume` as though it had not been.
///
/// # Errors
///
/// Those of the task and of the output folder; if learning cannot go on.
pub(crate) fn learn<T: Task>(line: &CommandLine<T::Args>, again: &str) -> anyhow::Result<Results> {
    let mut settings = line.settings.clone();
    settings.steps = line.learning.inner().or(settings.steps);
    let prepared = Prepared::<T>::new(settings, &line.args)?;
    let identity = prepared.identity();
    let Prepared { task, settings, description } = prepared;
    let plan = line.learning.plan(settings.variant, settings.seed, description.parameters)?;
    let mut study = task.study(&plan)?;
    let job = json!({
        "task": T::NAME,
        "plan": plan,
        "method": identity,
        "learned": study.identity(),
    });
    let out = out::<T>(&settings);
    let mut folder = Folder::open(&out)?;
    let mut log = Log::new(&folder, line.control.resume, study.as_mut(), &job.to_string())?;
    let mut progress = match settings.quiet {
        true => Progress::quiet(&interrupt::STOP),
        false => Progress::visible(&interrupt::STOP),
    };
    let stopped = walk(study.as_mut(), &mut log, &mut progress, plan.outer);
    progress.finish();
    let stopped = stopped.map_err(ended_learning)?;

    let done = log.updates();
    let start = log.validations().first().map(|point| point[1]);
    let learned = study.learned(&note(again, plan.seed, done, start))?;
    let partial =
        stopped.then(|| format!("{done} of {} outer steps are done and kept", plan.outer));
    let result = json!({
        "task": T::NAME,
        "command": Command::Learn.name(),
        "partial": partial,
        "softness": description.softness,
        "parameters": learned.parameters,
        "outer_steps": done,
        "start_validation_loss": start,
        "best": learned.best.map(|(step, loss)| json!({ "step": step, "validation_loss": loss })),
        "instances": { "tried": learned.instances[0], "dropped": learned.instances[1] },
        "seconds": learned.seconds,
        "peak_memory_mib": peak_rss_mib(),
        "inner_steps": description.steps,
        "size": description.size,
        "plan": plan,
        "settings": description.settings,
        "files": learned.files.iter().map(|(name, _)| out.join(name)).collect::<Vec<_>>(),
        "out": out,
    });
    let text = text::<T>(&result, &learned, &out);
    let charts = charts(&log, &learned)?;
    let page = report::of_learning((T::NAME, T::ABOUT), &text, &charts, &result, again);
    for (name, content) in &learned.files {
        folder.stage(name, content.as_bytes())?;
    }
    folder.stage(folder::REPORT, page.as_bytes())?;
    folder.stage(folder::LEARN, &serde_json::to_vec_pretty(&result)?)?;
    folder.commit()?;
    let warnings = warnings(&learned);
    Ok(Results { json: result.to_string(), text: text.join("\n"), warnings, partial })
}

/// Takes outer steps until learning has finished, or the user stops it: then true.
fn walk(
    study: &mut dyn Study,
    log: &mut Log,
    progress: &mut Progress,
    outer: usize,
) -> anyhow::Result<bool> {
    progress.expect(outer);
    progress.skip(1, log.updates());
    let before = log.updates();
    if progress.begin("learn".into(), 1, outer - before.min(outer)).is_err() {
        return Ok(true);
    }
    let mut loss = f64::NAN;
    while let Some(step) = study.advance()? {
        log.add(&step, study)?;
        loss = step.loss.unwrap_or(loss);
        if progress.step((step.step + 1).min(outer) - before, loss).is_err() {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The records of all outer steps so far, on file and here.
struct Log {
    records: std::path::PathBuf,
    checkpoint: std::path::PathBuf,
    job: String,
    steps: Vec<Point>,
}

struct Point {
    step: usize,
    loss: Option<f64>,
    validation: Option<f64>,
}

impl Log {
    /// Goes on from the checkpoint in the folder if asked to; else from the beginning.
    fn new(
        folder: &Folder,
        resume: bool,
        study: &mut dyn Study,
        job: &str,
    ) -> anyhow::Result<Self> {
        let (records, checkpoint) = (folder.journal(Command::Learn), folder.checkpoint());
        let mut log = Self { records, checkpoint, job: job.to_owned(), steps: Vec::new() };
        let mut kept = String::new();
        if resume && log.checkpoint.exists() {
            let next = study.resume(&log.checkpoint, job)?;
            let text = fs::read_to_string(&log.records).unwrap_or_default();
            // A step that came after the checkpoint was written will come again, and the line behind
            // the last line feed was being written when the program was killed.
            for line in text.split_inclusive('\n').filter(|line| line.ends_with('\n')) {
                let point = serde_json::from_str(line).ok().and_then(|record| point(&record));
                if let Some(point) = point.filter(|point| point.step < next) {
                    log.steps.push(point);
                    kept += line;
                }
            }
        } else if resume {
            eprintln!("there is no {}, so nothing to go on from", log.checkpoint.display());
        }
        fs::write(&log.records, kept).with_context(|| format!("cannot write {:?}", log.records))?;
        Ok(log)
    }

    fn add(&mut self, step: &OuterStep, study: &dyn Study) -> anyhow::Result<()> {
        let written = OpenOptions::new().append(true).open(&self.records);
        written
            .and_then(|mut file| writeln!(file, "{}", step.record))
            .with_context(|| format!("cannot write {:?}", self.records))?;
        study.save(&self.checkpoint, &self.job)?;
        let &OuterStep { step, loss, validation, .. } = step;
        self.steps.push(Point { step, loss, validation });
        Ok(())
    }

    fn updates(&self) -> usize {
        self.steps.iter().filter(|point| point.loss.is_some()).count()
    }

    fn losses(&self) -> Vec<[f64; 2]> {
        let point = |point: &Point| Some([point.step as f64, point.loss?]);
        self.steps.iter().filter_map(point).collect()
    }

    fn validations(&self) -> Vec<[f64; 2]> {
        let point = |point: &Point| Some([point.step as f64, point.validation?]);
        self.steps.iter().filter_map(point).collect()
    }
}

fn point(record: &Value) -> Option<Point> {
    Some(Point {
        step: usize::try_from(record["step"].as_u64()?).ok()?,
        loss: record["loss"].as_f64(),
        validation: record["validation_loss"].as_f64(),
    })
}

/// Where a softness comes from, for its file.
fn note(again: &str, seed: u64, updates: usize, start: Option<f64>) -> String {
    let from = start.map(|loss| format!(", from a validation loss of {}", short(loss)));
    let from = from.unwrap_or_default();
    format!("learned in {updates} outer steps on seeds from {seed}{from} by: {again}")
}

fn text<T: Task>(result: &Value, learned: &Learned, out: &Path) -> Vec<String> {
    let mut lines = vec![format!(
        "{}: learned {} parameters of {} in {} outer steps of {} inner ones, {:.1} s",
        T::NAME,
        learned.parameters,
        result["softness"].as_str().unwrap_or_default(),
        result["outer_steps"],
        result["inner_steps"],
        learned.seconds,
    )];
    if let Some((step, loss)) = learned.best {
        let start = result["start_validation_loss"].as_f64().map_or("none".into(), short);
        lines.push(format!(
            "validation loss {start} at the start, {} at the best, after {step} updates",
            short(loss)
        ));
    }
    for (name, _) in &learned.files {
        lines.push(format!("{}", out.join(name).display()));
    }
    lines.push(format!("report: {}", out.join(folder::REPORT).display()));
    lines
}

fn warnings(learned: &Learned) -> Vec<String> {
    let mut warnings = Vec::new();
    let [tried, dropped] = learned.instances;
    if dropped > 0 {
        warnings.push(format!(
            "{dropped} of {tried} training instances were left out, because their loss or gradient was \
             not finite: a wider softness or fewer inner steps may help"
        ));
    }
    if learned.best.is_some_and(|(step, _)| step == 0) {
        warnings.push(
            "no update made the validation loss lower, so the softness is that of the start: try \
             another --outer-rate or --order, or a larger --batch"
                .into(),
        );
    }
    warnings
}

/// The loss over the outer steps and the learned functions, as SVG with captions.
fn charts(log: &Log, learned: &Learned) -> anyhow::Result<Vec<(String, String)>> {
    let curve = |name: &str, points| Curve { name: name.into(), points };
    let losses = Figure {
        caption: "Mean outer loss of the batch of each outer step, whose instances differ from step to \
                  step, and of the validation instances, which are always the same. The softness with \
                  the lowest validation loss is kept."
            .into(),
        axes: ["outer step".into(), "outer loss".into()],
        logarithmic: [false; 2],
        curves: vec![curve("batch", log.losses()), curve("validation", log.validations())],
    };
    let figures = std::iter::once(&losses).chain(&learned.figures);
    figures.map(|figure| Ok((figure.svg()?, figure.caption.clone()))).collect()
}
