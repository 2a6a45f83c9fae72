use std::{
    ffi::OsString,
    io::{self, Write},
    path::PathBuf,
    process::ExitCode,
    time::Instant,
};

use anyhow::Context;
use clap::{CommandFactory, FromArgMatches};

use crate::{
    Command, Error, Failure, Progress, Run, Task, animation, chart,
    folder::{self, Folder},
    job, picture, report,
    settings::CommandLine,
    summary::Summary,
    table,
};

/// The whole `main` of a task binary.
pub fn main<T: Task>() -> ExitCode {
    match execute::<T>(std::env::args_os(), &mut io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::from(failure.code)
        }
    }
}

/// Does what a command line asks, the name of the program being its first word.
///
/// Results go to `stdout` and to the output folder, progress and warnings to stderr.
///
/// # Errors
///
/// Everything that should end the program with an error line. Unless only `stdout` failed, no
/// result file was touched then.
pub fn execute<T: Task>(
    words: impl IntoIterator<Item = OsString>,
    stdout: &mut dyn Write,
) -> Result<(), Failure> {
    let words: Vec<OsString> = words.into_iter().collect();
    let mut line = match parse::<T>(&words) {
        Ok(line) => line,
        Err(help) if !help.use_stderr() => {
            let text = help.render().to_string();
            return Ok(writeln!(stdout, "{}", text.trim_end()).context(STDOUT)?);
        }
        Err(wrong) => return Err(wrong.into()),
    };
    line.settings.reconcile(line.command).map_err(anyhow::Error::from)?;
    let summary = work::<T>(&line, &repeat::<T>(&words))?;
    for warning in summary.first_warnings() {
        eprintln!("warning: {warning}");
    }
    let shown = match line.settings.json {
        true => serde_json::to_string(&summary).context("cannot write the results as JSON")?,
        false => summary.text(),
    };
    Ok(writeln!(stdout, "{shown}").context(STDOUT)?)
}

const STDOUT: &str = "cannot write to the standard output";

fn parse<T: Task>(words: &[OsString]) -> Result<CommandLine<T::Args>, clap::Error> {
    let out = format!("Folder for the results; made if missing [default: out/{}]", T::NAME);
    let command = CommandLine::<T::Args>::command()
        .name(T::NAME)
        .version(env!("CARGO_PKG_VERSION"))
        .about(T::ABOUT)
        .mut_arg("out", |arg| arg.help(out));
    CommandLine::from_arg_matches(&command.try_get_matches_from(words)?)
}

/// Runs the task and writes its files.
fn work<T: Task>(line: &CommandLine<T::Args>, command: &str) -> anyhow::Result<Summary> {
    let settings = &line.settings;
    let task = T::prepare(settings, &line.args)?;
    let description = task.describe();
    let out = settings.out.clone().unwrap_or_else(|| PathBuf::from("out").join(T::NAME));
    let folder = Folder::open(&out)?;

    let count = match line.command {
        Command::Solve => 1,
        Command::Evaluate => settings.runs.unwrap_or(description.runs),
    };
    let seeds: Vec<u64> = (0..count as u64).map(|k| settings.seed.wrapping_add(k)).collect();
    let batches = count.div_ceil(task.batch_size().max(1));
    let mut progress = match settings.quiet {
        true => Progress::hidden(),
        false => Progress::visible(batches * description.steps),
    };
    let start = Instant::now();
    let runs = job::solve_all(&task, &description, &seeds, &mut progress);
    progress.finish();
    let (runs, seconds) = (runs?, start.elapsed().as_secs_f64());

    let summary = Summary::new(T::NAME, line.command, settings, &description, &runs, seconds, out);
    let chart = chart::svg(&description, &runs)?;
    let pictures = Encoded::new(&runs)?;
    let page = report::html(T::ABOUT, &summary, &runs, &chart, pictures.as_ref(), command);
    let curve = table::csv(&description, &runs);
    write(folder, pictures.as_ref(), &curve, &page, &serde_json::to_vec_pretty(&summary)?)?;
    Ok(summary)
}

fn write(
    mut folder: Folder,
    pictures: Option<&Encoded>,
    curve: &str,
    page: &str,
    result: &[u8],
) -> Result<(), Error> {
    if let Some(pictures) = pictures {
        folder.stage(folder::BEFORE_AFTER, &pictures.before_after)?;
        folder.stage(folder::ANIMATION, &pictures.animation)?;
    }
    folder.stage(folder::CURVE, curve.as_bytes())?;
    folder.stage(folder::REPORT, page.as_bytes())?;
    folder.stage(folder::RESULT, result)?;
    folder.commit()
}

/// Pictures of the first run as files.
pub(crate) struct Encoded {
    /// PNG.
    pub(crate) before_after: Vec<u8>,
    /// GIF.
    pub(crate) animation: Vec<u8>,
}

/// Small pictures are enlarged to at least this width, in pixels.
const PICTURE_WIDTH: u32 = 256;

impl Encoded {
    fn new(runs: &[Run]) -> anyhow::Result<Option<Self>> {
        let Some(pictures) = runs.iter().find_map(|run| run.pictures.as_ref()) else {
            return Ok(None);
        };
        let row = [
            ("target", &pictures.target),
            ("start", &pictures.start),
            ("result", &pictures.result),
            ("difference", &pictures.difference),
        ];
        let row = picture::labelled_row(&row, PICTURE_WIDTH);
        let mut png = io::Cursor::new(Vec::new());
        row.write_to(&mut png, image::ImageFormat::Png)
            .context("cannot encode before_after.png")?;
        let animation = animation::gif(&pictures.target, &pictures.frames)
            .context("cannot encode animation.gif")?;
        Ok(Some(Self { before_after: png.into_inner(), animation }))
    }
}

/// The command line that gives the same results again.
fn repeat<T: Task>(words: &[OsString]) -> String {
    let mut command = format!("cargo run --release -p {} --", T::NAME);
    for word in words.iter().skip(1) {
        let word = word.to_string_lossy();
        let plain = |c: char| c.is_alphanumeric() || "-_=./,+:@%".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            command += &format!(" {word}");
        } else {
            command += &format!(" '{}'", word.replace('\'', r"'\''"));
        }
    }
    command
}
