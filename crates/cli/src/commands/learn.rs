use std::{
    fs::{self, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
};

use anyhow::Context;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use softrast_inverse::{Learning, ScheduledSoftness};
use softrast_lab::{
    Error, Experiment, OutputFolder, Progress, World,
    format::{line, short, short_or_none},
    peak_rss_mib,
    plot::{Axis, Plot, Series},
    program::{Output, say},
    report::{Beside, Report},
    shown, write_atomically,
};
use softrast_meta::{Best, Ranks, Record};
use softrast_raster::HostBackend;
use softrast_tensor::Backend;

use super::settings_section;
use crate::{
    Purpose, Task, TaskExperiment,
    command_line::{Learn, Shared},
    learned_charts::learned_charts,
    session::Session,
};

const SOFTNESS: &str = "softness.json";
const RESULT: &str = "learn.json";
/// The checkpoint of `--resume`, and the records of all steps; every such file begins like this.
const CHECKPOINT: &str = "learn.checkpoint.json";
const RECORDS: &str = "learn.jsonl";
const BEGINS: &str = "{\"step\":";

/// Learns a softness, and writes it with a report; together with the other processes of `mpirun`,
/// of which only the first writes and prints.
///
/// Every outer step appends a line to `learn.jsonl` and then writes a checkpoint, so that
/// `--resume` continues a program killed at any moment as if it had never stopped.
pub(crate) fn learn<T: Task>(
    session: &Session,
    flags: Learn<T::Args>,
) -> anyhow::Result<Option<Output>> {
    let world = World::join()?;
    learn_with::<T>(session, flags, &world).map_err(|error| world.fail(error))
}

fn learn_with<T: Task>(
    session: &Session,
    flags: Learn<T::Args>,
    world: &World,
) -> anyhow::Result<Option<Output>> {
    let Learn { shared: Shared { args, mut common, mut method }, learn, resume } = flags;
    method.reconcile().map_err(Error::usage)?;
    if method.resolution.is_some() {
        return Err(Error::usage("learn draws at --size: leave out --resolution"));
    }
    let host = HostBackend::name(&Default::default());
    if common.backend.take().is_some_and(|asked| asked != host) {
        let message = format!("learn is compiled for {host} alone: leave out --backend");
        return Err(Error::usage(message));
    }
    let experiment = TaskExperiment::<T>::new(&args, &common, &method, Purpose::Learning)?;
    if world.is_first() {
        let own = experiment.task.own_file(&experiment.task.own_phi(), "");
        let own = own.context("the softness")?.map(|(name, _)| name);
        session.claim([SOFTNESS, RESULT].into_iter().chain(own))?;
    }
    let (about, identity) = (experiment.about(), experiment.identity());
    let TaskExperiment { task, method, solve, .. } = experiment;
    let (own_start, takes_rate) = (task.own_phi(), task.takes_learning_rate());
    let task = std::rc::Rc::into_inner(task).context("a task has one owner")?;
    let config = learn.config(common.seed);
    let learning = Learning::<T, HostBackend>::new(task, &method, &solve, &config);
    let mut learning = learning.map_err(|error| Error::usage(error.to_string()))?;
    let job = json!({ "task": T::NAME, "method": identity, "learned": learning.identity() });
    let mut folder = session.folder()?;
    let (job, writes) = (job.to_string(), world.is_first());
    let mut log = Log::new(&mut folder, resume.resume, &mut learning, &job, writes)?;
    let mut progress = Progress::of_program(session.quiet || !world.is_first());
    let stopped = walk(&mut learning, &mut log, &mut folder, &mut progress, world);
    progress.finish();
    let kept = "learning stopped; what was learned before is kept, and --resume goes on from it";
    let stopped = stopped.context(kept)?;
    if !world.is_first() {
        return Ok(None);
    }

    let (mut softness, own) = learning.learned();
    softness.note = Some(note(session, &learning, &log));
    softness.task = Some(T::NAME.to_owned());
    softness.learning_rate = softness.learning_rate.filter(|_| takes_rate);
    let learned = Learned { softness, own: [own_start, own], stopped };
    write(session, folder, &learning, &log, &about, &learned).map(Some)
}

/// Result of learning.
struct Learned {
    softness: ScheduledSoftness,
    /// Parameters of the task's own softness, before and after.
    own: [Vec<f64>; 2],
    /// Whether the user stopped it.
    stopped: bool,
}

/// Writes and reports the learned softness.
fn write<T: Task>(
    session: &Session,
    mut folder: OutputFolder,
    learning: &Learning<T, HostBackend>,
    log: &Log,
    about: &Map<String, Value>,
    learned: &Learned,
) -> anyhow::Result<Output> {
    let Learned { softness, own: [own_start, own], stopped } = learned;
    let (done, updates) = (log.updates(), learning.config().updates);
    let partial = stopped.then(|| format!("{done} of {updates} outer steps are done and kept"));
    let files = files(learning, softness, own)?;
    for (name, content) in &files {
        folder.stage(name, content.as_bytes())?;
    }
    let files: Vec<PathBuf> = files.iter().map(|(name, _)| session.out.join(name)).collect();
    let progress = learning.progress();
    let best = progress.best.as_ref();
    let result = json!({
        "partial": partial,
        "softness": about["softness"],
        "parameters": progress.phi.len(),
        "outer_steps": done,
        "start_validation_loss": log.start(),
        "best": best.map(|best| json!({ "step": best.step, "validation_loss": best.loss })),
        "instances": { "tried": progress.tried, "dropped": progress.dropped },
        "seconds": progress.seconds,
        "peak_memory_mib": peak_rss_mib(),
        "inner_steps": about["steps"],
        "size": about["size"],
        "faces": about["faces"],
        "config": learning.config(),
        "settings": about["settings"],
        "files": files.iter().map(|file| shown(file)).collect::<Vec<_>>(),
    });
    let mut text = text(learning, log, about);
    text.extend(files.iter().map(|file| line("learned", &file.display().to_string())));
    let mut report = Report::new(T::NAME, T::ABOUT);
    report.stopped(partial.as_deref());
    report.heading("Learning");
    text.iter().for_each(|text| report.paragraph(text.trim()));
    report.chart(&losses(log).svg()?, LOSSES);
    let charts = learned_charts(learning.layout(), softness).into_iter();
    for (plot, caption) in charts.chain(learning.problem().own_chart(own_start, own)) {
        report.chart(&plot.svg()?, caption);
    }
    let settings = ["config", "settings"].map(|key| result[key].as_object());
    if let [Some(config), Some(settings)] = settings {
        settings_section(&mut report, [config, settings]);
    }
    let beside = [
        Beside::new(RESULT, "the result"),
        Beside::new("learn.jsonl", "a line for every outer step"),
        Beside::new("softness.json", "the softness, for --softness of any task"),
    ];
    let output = Output { json: result, text, warnings: warnings(learning), partial };
    session.finish(folder, report, &beside, Some(RESULT), output)
}

/// Takes outer steps until learning has finished, or the user stops it; returns whether it was stopped.
fn walk<T: Task>(
    learning: &mut Learning<T, HostBackend>,
    log: &mut Log,
    folder: &mut OutputFolder,
    progress: &mut Progress,
    world: &World,
) -> anyhow::Result<bool> {
    let outer = learning.config().updates;
    let before = log.updates();
    progress.expect(outer);
    progress.skip(1, before);
    if world.any(progress.begin("learn".into(), 1, outer - before.min(outer)).is_err()) {
        return Ok(true);
    }
    let mut loss = f64::NAN;
    while let Some(record) = learning.step_shared(&Processes(world))? {
        log.add(&record, learning, folder)?;
        loss = record.loss.unwrap_or(loss);
        let stopped = progress.step((record.step + 1).min(outer) - before, loss).is_err();
        // The signal may reach only some of the ranks.
        if world.any(stopped) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The processes of `mpirun`, for the outer loop.
struct Processes<'a>(&'a World);

impl Ranks for Processes<'_> {
    fn rank(&self) -> usize {
        self.0.rank()
    }

    fn count(&self) -> usize {
        self.0.count()
    }

    fn gather(&self, numbers: &[f64]) -> Vec<f64> {
        self.0.gather(numbers)
    }
}

/// The records of all outer steps so far, on file and in memory.
struct Log {
    /// Whether this process writes them.
    writes: bool,
    records: PathBuf,
    checkpoint: PathBuf,
    job: String,
    steps: Vec<Point>,
}

/// The fields of a record that the charts use.
#[derive(Deserialize)]
struct Point {
    step: usize,
    loss: Option<f64>,
    validation_loss: Option<f64>,
}

/// The contents of a regular file; opening a pipe or a device could block for ever.
fn whole(path: &Path) -> io::Result<Vec<u8>> {
    match fs::metadata(path)?.is_file() {
        true => fs::read(path),
        false => Err(io::Error::other("it is not a regular file")),
    }
}

impl Log {
    /// Continues from the checkpoint in the folder if requested; otherwise starts anew.
    fn new<T: Task>(
        folder: &mut OutputFolder,
        resume: bool,
        learning: &mut Learning<T, HostBackend>,
        job: &str,
        writes: bool,
    ) -> anyhow::Result<Self> {
        let (records, checkpoint) = (folder.file(RECORDS), folder.file(CHECKPOINT));
        let (job, steps) = (job.to_owned(), Vec::new());
        let mut log = Self { writes, records, checkpoint, job, steps };
        let mut kept = String::new();
        if resume && log.checkpoint.exists() {
            let named = || log.checkpoint.display().to_string();
            let checkpoint = whole(&log.checkpoint).with_context(named)?;
            learning.resume(&checkpoint, &log.job).with_context(named)?;
            let progress = learning.progress();
            // The file also has the record of the last step, which makes no update.
            let next = progress.step + usize::from(progress.finished);
            let text = whole(&log.records).unwrap_or_default();
            // Steps after the checkpoint are repeated, and the text after the last line feed is an
            // incomplete line of a killed program.
            for line in String::from_utf8_lossy(&text).split_inclusive('\n') {
                let Ok(point) = serde_json::from_str::<Point>(line) else { continue };
                let follows = log.steps.last().is_none_or(|last| last.step < point.step);
                if follows && point.step < next && line.ends_with('\n') {
                    log.steps.push(point);
                    kept += line;
                }
            }
            if writes {
                folder.adopt(CHECKPOINT)?;
            }
            if log.steps.len() < next && writes {
                say(&format!(
                    "{} of {next} records of {} are missing or damaged: the charts leave them out",
                    next - log.steps.len(),
                    log.records.display()
                ));
            }
        } else if resume && writes {
            say(&format!("there is no {}, so nothing to go on from", log.checkpoint.display()));
        }
        if writes {
            folder.claim([CHECKPOINT])?;
            folder.journal(RECORDS, BEGINS, resume)?;
            write_atomically(&log.records, kept.as_bytes())
                .with_context(|| format!("cannot write {:?}", log.records))?;
        }
        Ok(log)
    }

    fn add<T: Task>(
        &mut self,
        record: &Record,
        learning: &Learning<T, HostBackend>,
        folder: &mut OutputFolder,
    ) -> anyhow::Result<()> {
        if self.writes {
            let written = OpenOptions::new().append(true).open(&self.records);
            let line = serde_json::to_string(record)?;
            written
                .and_then(|mut file| writeln!(file, "{line}"))
                .with_context(|| format!("cannot write {:?}", self.records))?;
            folder.keep(CHECKPOINT, learning.checkpoint(&self.job)?.as_bytes())?;
        }
        let &Record { step, loss, validation_loss, .. } = record;
        self.steps.push(Point { step, loss, validation_loss });
        Ok(())
    }

    fn updates(&self) -> usize {
        let last = self.steps.iter().rfind(|point| point.loss.is_some());
        last.map_or(0, |point| point.step + 1)
    }

    /// The validation loss of the start.
    fn start(&self) -> Option<f64> {
        self.steps.iter().find_map(|point| point.validation_loss)
    }

    fn curve(&self, of: impl Fn(&Point) -> Option<f64>) -> Vec<[f64; 2]> {
        self.steps.iter().filter_map(|point| Some([point.step as f64, of(point)?])).collect()
    }
}

/// Origin of a softness, for its file.
fn note<T: Task>(session: &Session, learning: &Learning<T, HostBackend>, log: &Log) -> String {
    let from = log.start().map(|loss| format!(", from a validation loss of {}", short(loss)));
    let progress = learning.progress();
    let best = progress.best.as_ref();
    let best = best.map(|best| format!("; validation loss {:.6} after {}", best.loss, best.step));
    format!(
        "learned in {} outer steps on seeds from {}{} by: {}{}; {:.0} s",
        log.updates(),
        learning.config().seed,
        from.unwrap_or_default(),
        session.again,
        best.unwrap_or_default(),
        progress.seconds
    )
}

/// Softness files to pass on the command line: name and text.
fn files<T: Task>(
    learning: &Learning<T, HostBackend>,
    softness: &ScheduledSoftness,
    own: &[f64],
) -> anyhow::Result<Vec<(&'static str, String)>> {
    let name = SOFTNESS;
    let text = softness.text(Path::new(name)).context("the learned softness")?;
    let note = softness.note.as_deref().unwrap_or_default();
    let own = learning.problem().own_file(own, note).context("the learned softness")?;
    Ok([Some((name, text)), own].into_iter().flatten().collect())
}

fn text<T: Task>(
    learning: &Learning<T, HostBackend>,
    log: &Log,
    about: &Map<String, Value>,
) -> Vec<String> {
    let progress = learning.progress();
    let mut lines = vec![format!(
        "{}: learned {} parameters of {} in {} outer steps of {} inner ones, {:.1} s",
        T::NAME,
        progress.phi.len(),
        about["softness"].as_str().unwrap_or_default(),
        log.updates(),
        about["steps"],
        progress.seconds,
    )];
    if let Some(Best { step, loss, .. }) = &progress.best {
        let start = short_or_none(log.start().filter(|loss| loss.is_finite()));
        let best = short(*loss);
        let losses = format!("{start} at the start, {best} at the best, after {step} updates");
        lines.push(line("validation loss", &losses));
    }
    lines
}

fn warnings<T: Task>(learning: &Learning<T, HostBackend>) -> Vec<String> {
    let mut warnings = Vec::new();
    let progress = learning.progress();
    if progress.dropped > 0 {
        warnings.push(format!(
            "{} of {} training instances were left out, because their loss or gradient was not finite: a wider softness or fewer \
             inner steps may help",
            progress.dropped, progress.tried
        ));
    }
    if progress.best.as_ref().is_some_and(|best| best.step == 0) {
        warnings.push(
            "no update made the validation loss lower, so the softness is that of the start: try another --outer-rate or --estimator, or \
             a larger --batch"
                .into(),
        );
    }
    warnings
}

const LOSSES: &str = "Mean outer loss of the batch of each outer step, whose instances differ from step to step, and of the validation \
                      instances, which are always the same. The softness with the lowest validation loss is kept.";

/// The loss over the outer steps.
fn losses(log: &Log) -> Plot {
    let curves = [
        ("batch", log.curve(|point| point.loss)),
        ("validation", log.curve(|point| point.validation_loss)),
    ];
    let series =
        curves.map(|(name, points)| Series { name: name.into(), points, ..Series::default() });
    Plot {
        series: series.into(),
        ..Plot::new(Axis::linear("outer step"), Axis::linear("outer loss"))
    }
}
