use std::{
    ffi::OsString,
    io::{self, Write},
    process::ExitCode,
};

use anyhow::Context;
use clap::Parser;
use softrast_raster::{BackendChoice, compiled_backends, on_backend};
use softrast_runner::{Error, Failure, peak_rss_mib};

use crate::{
    args::Args,
    dense, fused,
    output::{self, Output},
    report::{Report, Setting},
    scene::Scene,
};

/// Timed repetitions unless asked for another number.
const REPEAT: usize = 5;
const STDOUT: &str = "cannot write to the standard output";

/// The whole `main` of the program.
pub fn main() -> ExitCode {
    match execute(std::env::args_os(), &mut io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::from(failure.code)
        }
    }
}

/// Does what a command line asks, the name of the program being its first word.
///
/// # Errors
///
/// Everything that should end the program with an error line. Unless only `stdout` failed, no
/// picture was written then.
pub fn execute(
    words: impl IntoIterator<Item = OsString>,
    stdout: &mut dyn Write,
) -> Result<(), Failure> {
    let args = match Args::try_parse_from(words) {
        Ok(args) => args,
        Err(help) if !help.use_stderr() => {
            let text = help.render().to_string();
            return Ok(writeln!(stdout, "{}", text.trim_end()).context(STDOUT)?);
        }
        Err(wrong) => return Err(wrong.into()),
    };
    let report = work(&args)?;
    if let Some(warning) = report.warning() {
        eprintln!("warning: {warning}");
    }
    let shown = match args.json {
        true => serde_json::to_string(&report).context("cannot write the results as JSON")?,
        false => report.text(),
    };
    Ok(writeln!(stdout, "{shown}").context(STDOUT)?)
}

fn work(args: &Args) -> anyhow::Result<Report> {
    if let Some(threads) = args.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        // Fails where threads run already: a library user has chosen their number.
        let _ = pool.build_global();
    }
    let asked = args.backend.as_deref();
    let backend = BackendChoice::among(compiled_backends!(), asked)
        .map_err(|error| Error::Usage(error.to_string()))?;
    if !args.reference {
        backend.set_up()?;
    }
    let scene = Scene::load(args)?;
    let output = Output::open(&args.out)?;
    let setting = Setting {
        backend: if args.reference { dense::BACKEND } else { backend.title() },
        repeat: args.repeat.unwrap_or(if args.reference { 1 } else { REPEAT }),
        base_rss_mib: peak_rss_mib(),
    };
    let measured = match args.reference {
        true => dense::measure(&scene, setting.repeat),
        false => on_backend!(backend, B => fused::measure::<B>(&scene, setting.repeat)),
    };
    output.write(&output::picture(&measured.alpha, scene.size))?;
    Ok(Report::new(args, &scene, &setting, &measured))
}
