use std::{cell::RefCell, ffi::OsString, io::Write, path::Path, process::ExitCode};

use clap::CommandFactory;
use softrast_lab::{
    Failure, Inputs,
    program::{parse, repeated, run_main},
};

use crate::{
    Common, Task,
    command_line::{Command, CommandLine},
    commands,
    session::Session,
};

/// The whole `main` of the program of a task.
pub fn main<T: Task>() -> ExitCode {
    run_main(execute::<T>)
}

/// The whole `main` of a program with two tasks that share their flags; `is_second` selects the second.
pub fn main_of_two<T, U>(is_second: fn(&T::Args) -> bool) -> ExitCode
where
    T: Task,
    U: Task<Args = T::Args, Pictures = T::Pictures>,
{
    run_main(move |words, stdout| execute_one_of::<T, U>(words, is_second, stdout))
}

/// Runs a command line; its first word is the name of the program.
///
/// Results go to `stdout` and to the output folder, progress and warnings to stderr.
///
/// # Errors
///
/// Every error that ends the program with an error line. Unless only `stdout` failed or the user stopped the work, no
/// result file has been changed then. After a stop, finished runs are written and printed first, as partial results.
pub fn execute<T: Task>(words: Vec<OsString>, stdout: &mut dyn Write) -> Result<(), Failure> {
    execute_one_of::<T, T>(words, |_| false, stdout)
}

/// [`execute`] for the task `U` if `is_second` of the flags, else for `T`.
fn execute_one_of<T, U>(
    words: Vec<OsString>,
    is_second: fn(&T::Args) -> bool,
    stdout: &mut dyn Write,
) -> Result<(), Failure>
where
    T: Task,
    U: Task<Args = T::Args, Pictures = T::Pictures>,
{
    let words = with_command::<T>(words);
    let command = CommandLine::<T::Args, T::Pictures>::command();
    // Help without a command lists the flags of `solve`; command lines get `solve` inserted before parsing.
    let solve = command.find_subcommand("solve").into_iter();
    let of_solve: Vec<_> = solve.flat_map(clap::Command::get_arguments).cloned().collect();
    let command = command
        .name(T::PROGRAM)
        .version(env!("CARGO_PKG_VERSION"))
        .about(T::ABOUT)
        .args(of_solve)
        .args_conflicts_with_subcommands(true)
        .after_help("Without a command: solve. `COMMAND --help` lists the flags of a command.");
    let line = parse::<CommandLine<T::Args, T::Pictures>>(command.clone(), &words, stdout);
    let Some(line) = line.map_err(|failure| with_owner(failure, &command))? else {
        return Ok(());
    };
    match is_second(&line.command.shared().1.args) {
        true => run::<U>(line, &words, stdout),
        false => run::<T>(line, &words, stdout),
    }
}

/// Runs a parsed command line; `words` are its words.
fn run<T: Task>(
    line: CommandLine<T::Args, T::Pictures>,
    words: &[OsString],
    stdout: &mut dyn Write,
) -> Result<(), Failure> {
    let (command, shared) = line.command.shared();
    let Common { json, quiet, ref out, .. } = shared.common;
    // Results of different commands are kept separate.
    let folder = if command == "solve" { T::NAME.into() } else { format!("{}-{command}", T::NAME) };
    let session = Session {
        again: repeated(T::PROGRAM, words),
        command,
        task: T::NAME,
        program: T::PROGRAM,
        inputs: RefCell::new(Inputs::of_words(words, &["--out"])),
        out: out.clone().unwrap_or_else(|| Path::new("out").join(folder)),
        quiet,
    };
    let output = match line.command {
        Command::Solve(flags) => commands::evaluate::solve::<T>(&session, *flags)?,
        Command::Evaluate(flags) => commands::evaluate::evaluate::<T>(&session, flags)?,
        Command::Search(flags) => commands::search::search::<T>(&session, flags)?,
        Command::Choose(flags) => commands::choose::choose::<T>(&session, flags)?,
        Command::Learn(flags) => match commands::learn::learn::<T>(&session, flags)? {
            Some(output) => output,
            None => return Ok(()),
        },
    };
    output.print(json, &session.again, stdout)
}

/// An error about a flag that the command lacks, with the commands that have it.
fn with_owner(mut failure: Failure, command: &clap::Command) -> Failure {
    let flag = failure.message.strip_prefix("unexpected argument '--");
    let Some(flag) = flag.and_then(|rest| rest.split('\'').next()) else {
        return failure;
    };
    let has = |command: &&clap::Command| {
        command.get_arguments().any(|argument| {
            let mut aliases = argument.get_all_aliases().into_iter().flatten();
            argument.get_long() == Some(flag) || aliases.any(|alias| alias == flag)
        })
    };
    let owners: Vec<&str> =
        command.get_subcommands().filter(has).map(clap::Command::get_name).collect();
    if !owners.is_empty() {
        failure.message = format!("--{flag} goes with {} (see --help)", owners.join(", "));
    }
    failure
}

/// The words, with `solve` inserted if they name no command.
fn with_command<T: Task>(mut words: Vec<OsString>) -> Vec<OsString> {
    let general = ["-h", "--help", "-V", "--version", "help"];
    let command = CommandLine::<T::Args, T::Pictures>::command();
    let known = |word: &str| general.contains(&word) || command.find_subcommand(word).is_some();
    let named = words.get(1).and_then(|word| word.to_str()).is_some_and(known);
    if !named {
        words.insert(words.len().min(1), "solve".into());
    }
    words
}
