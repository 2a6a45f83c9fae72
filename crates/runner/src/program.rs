use std::{
    ffi::OsString,
    io::{self, Write},
    process::ExitCode,
};

use anyhow::Context;
use clap::{CommandFactory, FromArgMatches};

use crate::{
    Command, Failure, Task, command, error::INTERRUPTED, interrupt, settings::CommandLine,
};

/// The whole `main` of a task binary.
pub fn main<T: Task>() -> ExitCode {
    interrupt::listen();
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
/// Everything that should end the program with an error line. Unless only `stdout` failed or the
/// user stopped the work, no result file was touched then. What a user who stops it has finished is
/// written and printed before, as partial.
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
    line.control.check(line.command).map_err(anyhow::Error::from)?;
    line.learning.check(line.command).map_err(anyhow::Error::from)?;
    let again = repeat::<T>(&words);
    if let Some(says) = command::resolve::<T>(&mut line)? {
        eprintln!("{says}");
    }
    let results = match line.command {
        Command::Solve | Command::Evaluate => command::evaluate::<T>(&line, &again)?,
        Command::Search => command::search::<T>(&line, &again)?,
        Command::Learn => command::learn::<T>(&line, &again)?,
        Command::Choose => command::choose::<T>(&line, &again)?,
    };
    for warning in &results.warnings {
        eprintln!("warning: {warning}");
    }
    let shown = if line.settings.json { &results.json } else { &results.text };
    writeln!(stdout, "{shown}").context(STDOUT)?;
    match results.partial {
        None => Ok(()),
        Some(finished) => {
            let message = format!("{finished}; go on with: {again} --resume");
            Err(Failure { code: INTERRUPTED, message })
        }
    }
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

/// The command line that gives the same results again from the beginning.
fn repeat<T: Task>(words: &[OsString]) -> String {
    let mut command = format!("cargo run --release -p {} --", T::NAME);
    for word in words.iter().skip(1).filter(|word| *word != "--resume") {
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
