//! The frame of every program: parses the command line, prints one error line or the results.

use std::{
    ffi::OsString,
    io::{self, Write},
    process::ExitCode,
};

use anyhow::Context;
use clap::Parser;
use serde_json::Value;

use crate::{
    Failure, error::INTERRUPTED, printable, progress::stop_on_ctrl_c, shown::printable_json,
};

/// Output of a command after its files are written.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// For programs.
    pub json: Value,
    /// For people, line by line.
    pub text: Vec<String>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Progress of the work if the user stopped it.
    pub partial: Option<String>,
}

/// Stack of each thread in bytes, as that of the main thread.
const STACK: usize = 8 << 20;

/// The whole `main` of a program: `execute` gets the words of the command line, the name of the program first, and a writer for results.
///
/// It runs on a thread of the pool that parallel ops use. From another thread, each op would have to wake the pool, about 40 microseconds.
pub fn run_main(
    execute: impl FnOnce(Vec<OsString>, &mut dyn Write) -> Result<(), Failure> + Send,
) -> ExitCode {
    stop_on_ctrl_c();
    // Fails if a pool exists already, which serves as well.
    let _ = rayon::ThreadPoolBuilder::new().stack_size(STACK).build_global();
    match rayon::scope(|_| execute(std::env::args_os().collect(), &mut io::stdout().lock())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::from(failure.code)
        }
    }
}

/// Parses a command line. If it requests help, prints it and returns `None`.
///
/// # Errors
///
/// The mistake, in one line.
pub fn parse<P: Parser>(
    command: clap::Command,
    words: &[OsString],
    stdout: &mut dyn Write,
) -> Result<Option<P>, Failure> {
    let parsed = command.try_get_matches_from(words).and_then(|found| P::from_arg_matches(&found));
    match parsed {
        Ok(line) => Ok(Some(line)),
        Err(help) if !help.use_stderr() => {
            let text = help.render().to_string();
            writeln!(stdout, "{}", text.trim_end()).context(STDOUT)?;
            Ok(None)
        }
        Err(wrong) => Err(wrong.into()),
    }
}

impl Output {
    /// Prints warnings to stderr and the rest to `stdout`; `again` is the command to continue with.
    ///
    /// # Errors
    ///
    /// If it cannot be written, or the work is unfinished.
    pub fn print(&self, as_json: bool, again: &str, stdout: &mut dyn Write) -> Result<(), Failure> {
        /// Most warnings printed; the results have all of them.
        const SHOWN: usize = 3;
        for warning in self.warnings.iter().take(SHOWN) {
            eprintln!("warning: {}", printable(warning));
        }
        if self.warnings.len() > SHOWN {
            eprintln!("warning: and {} more, listed in the results", self.warnings.len() - SHOWN);
        }
        let (json, text) = (self.json.to_string(), self.text.join("\n"));
        let shown = if as_json { printable_json(&json) } else { printable(&text) };
        writeln!(stdout, "{shown}").context(STDOUT)?;
        match &self.partial {
            None => Ok(()),
            Some(finished) => {
                let message = format!("{finished}; go on with: {again} --resume");
                Err(Failure { code: INTERRUPTED, message })
            }
        }
    }
}

/// Prints a line to stderr, above the progress bar.
pub fn say(line: &str) {
    eprintln!("{}", printable(line));
}

const STDOUT: &str = "cannot write to the standard output";

/// The command line that reproduces the results from the beginning.
pub fn repeated(package: &str, words: &[OsString]) -> String {
    let words = words.iter().skip(1).filter(|word| *word != "--resume");
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let quoted = shlex::try_join(words.iter().map(String::as_str)).unwrap_or_default();
    format!("cargo run --release -p {package} -- {quoted}").trim_end_matches(" -- ").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_repeated_as_one_would_type_it() {
        let words = ["pose", "evaluate", "--resume", "--mesh", "a b.obj", "--scale"];
        let words = words.map(OsString::from);
        let expected = "cargo run --release -p pose -- evaluate --mesh 'a b.obj' --scale";
        assert_eq!(repeated("pose", &words), expected);
        assert_eq!(repeated("pose", &words[..1]), "cargo run --release -p pose");
    }

    #[test]
    fn an_unfinished_command_says_how_to_go_on() {
        let mut stdout = Vec::new();
        let output =
            Output { partial: Some("1 of 2 runs are finished".into()), ..Output::default() };
        let failure = output.print(true, "pose evaluate", &mut stdout).unwrap_err();
        assert_eq!(failure.code, INTERRUPTED);
        assert!(failure.message.ends_with("go on with: pose evaluate --resume"));
        assert_eq!(stdout, b"null\n");
    }
}
