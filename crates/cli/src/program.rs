use std::{ffi::OsString, io::Write, path::PathBuf, process::ExitCode};

use clap::{Args, CommandFactory, Parser, Subcommand};
use softrast_lab::{
    Cache, Failure, OutputFolder, Progress, Runner,
    parse::{count, positive},
    program::{parse, repeated, run_main},
};

use crate::{Common, MethodArgs, Task, commands, commands::learn_args::LearnArgs};

/// Everything on the command line of a task.
#[derive(Debug, Parser)]
#[command(subcommand_required = true)]
struct CommandLine<A: Args> {
    #[command(subcommand)]
    command: Command<A>,
}

/// What a program can be asked to do; `solve` if nothing else is said.
#[derive(Clone, Debug, Subcommand)]
enum Command<A: Args> {
    /// Solve one instance and show it; what is done where no command is named
    Solve(Solve<A>),
    /// Solve many seeds and give means with confidence intervals
    Evaluate(Evaluate<A>),
    /// Find the best scale and learning rate on training seeds, then evaluate them on others
    Search(Search<A>),
    /// Find the simplest softness, the fewest pixels, the largest tolerance and the coarsest mesh that are as good as the best
    Choose(Choose<A>),
    /// Learn the softness on training seeds, by the gradient of what a whole run ends with
    Learn(Learn<A>),
}

/// Flags that every command has.
#[derive(Args, Clone, Debug)]
pub(crate) struct Shared<A: Args> {
    #[command(flatten)]
    pub(crate) args: A,
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct Solve<A: Args> {
    #[command(flatten)]
    pub(crate) shared: Shared<A>,
    #[command(flatten)]
    pub(crate) auto: Auto,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct Evaluate<A: Args> {
    #[command(flatten)]
    pub(crate) shared: Shared<A>,
    /// Number of seeds
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub(crate) runs: Option<usize>,
    /// Second method for the same seeds, with flags of its own in quotes: "gauss --scale 0.01"
    #[arg(long, value_name = "NAME|FILE.json", value_parser = MethodArgs::parse)]
    pub(crate) against: Option<MethodArgs>,
    #[command(flatten)]
    pub(crate) resume: Resume,
    #[command(flatten)]
    pub(crate) auto: Auto,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct Search<A: Args> {
    #[command(flatten)]
    pub(crate) shared: Shared<A>,
    /// Number of seeds to evaluate what is found on
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub(crate) runs: Option<usize>,
    /// Scales to try; each pair of a wider and a narrower one is a decay
    #[arg(long, value_name = "X,X...", value_delimiter = ',', value_parser = positive)]
    pub(crate) scales: Vec<f64>,
    /// Learning rates to try
    #[arg(long, value_name = "X,X...", value_delimiter = ',', value_parser = positive)]
    pub(crate) learning_rates: Vec<f64>,
    #[command(flatten)]
    pub(crate) training: Training,
    #[command(flatten)]
    pub(crate) resume: Resume,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct Choose<A: Args> {
    #[command(flatten)]
    pub(crate) shared: Shared<A>,
    #[command(flatten)]
    pub(crate) auto: Auto,
    #[command(flatten)]
    pub(crate) training: Training,
    #[command(flatten)]
    pub(crate) resume: Resume,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct Learn<A: Args> {
    #[command(flatten)]
    pub(crate) shared: Shared<A>,
    #[command(flatten)]
    pub(crate) learn: LearnArgs,
    #[command(flatten)]
    pub(crate) resume: Resume,
}

/// How long may be looked for a method.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Auto {
    /// Seconds that choosing a method may take [default: no limit]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) budget: Option<f64>,
}

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Training {
    /// Training seeds, counted from 1000000, that every setting is tried on
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 8, allow_negative_numbers = true)]
    pub(crate) search_runs: usize,
}

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Resume {
    /// Go on from what an interrupted call has finished
    #[arg(long)]
    pub(crate) resume: bool,
}

/// What a command works with, beside its flags.
pub(crate) struct Session {
    /// The command line that gives the same results again.
    pub(crate) again: String,
    /// Name of the command.
    pub(crate) command: &'static str,
    /// Where results go.
    pub(crate) out: PathBuf,
    pub(crate) quiet: bool,
}

impl Session {
    pub(crate) fn folder(&self) -> anyhow::Result<OutputFolder> {
        Ok(OutputFolder::open(&self.out)?)
    }

    /// Somebody to run experiments, who keeps what is finished on file unless the command is `solve`.
    pub(crate) fn runner(&self, folder: &OutputFolder, resume: bool) -> anyhow::Result<Runner> {
        let progress = Progress::of_program(self.quiet);
        let path = folder.file(&format!("{}.jsonl", self.command));
        let cache = match (self.command, resume) {
            ("solve", _) => Cache::in_memory(),
            (_, false) => Cache::fresh(&path),
            (_, true) => {
                let (cache, note) = Cache::open(&path)?;
                note.iter().for_each(|note| eprintln!("{note}"));
                cache
            }
        };
        Ok(Runner { progress, cache })
    }
}

/// The whole `main` of the program of a task.
pub fn main<T: Task>() -> ExitCode {
    run_main(execute::<T>)
}

/// Does what a command line asks, the name of the program being its first word.
///
/// Results go to `stdout` and to the output folder, progress and warnings to stderr.
///
/// # Errors
///
/// Everything that should end the program with an error line. Unless only `stdout` failed or the user stopped the work, no result file
/// was touched then. What a user who stops it has finished is written and printed before, as partial.
pub fn execute<T: Task>(words: Vec<OsString>, stdout: &mut dyn Write) -> Result<(), Failure> {
    let words = with_command::<T>(words);
    let command = CommandLine::<T::Args>::command()
        .name(T::NAME)
        .version(env!("CARGO_PKG_VERSION"))
        .about(T::ABOUT)
        .after_help("Without a command: solve. `COMMAND --help` lists the flags of a command.");
    let line = parse::<CommandLine<T::Args>>(command.clone(), &words, stdout);
    let Some(line) = line.map_err(|failure| with_owner(failure, &command))? else {
        return Ok(());
    };
    let (name, shared) = match &line.command {
        Command::Solve(Solve { shared, .. }) => ("solve", shared),
        Command::Evaluate(Evaluate { shared, .. }) => ("evaluate", shared),
        Command::Search(Search { shared, .. }) => ("search", shared),
        Command::Choose(Choose { shared, .. }) => ("choose", shared),
        Command::Learn(Learn { shared, .. }) => ("learn", shared),
    };
    let Common { json, quiet, ref out, .. } = shared.common;
    let out = out.clone().unwrap_or_else(|| PathBuf::from("out").join(T::NAME));
    let session = Session { again: repeated(T::NAME, &words), command: name, out, quiet };
    let output = match line.command {
        Command::Solve(flags) => commands::evaluate::solve::<T>(&session, flags)?,
        Command::Evaluate(flags) => commands::evaluate::evaluate::<T>(&session, flags)?,
        Command::Search(flags) => commands::search::search::<T>(&session, flags)?,
        Command::Choose(flags) => commands::choose::choose::<T>(&session, flags)?,
        Command::Learn(flags) => commands::learn::learn::<T>(&session, flags)?,
    };
    output.print(json, &session.again, stdout)
}

/// An error about a flag that the command does not have, with the commands that do.
fn with_owner(mut failure: Failure, command: &clap::Command) -> Failure {
    let flag = failure.message.strip_prefix("unexpected argument '--");
    let Some(flag) = flag.and_then(|rest| rest.split('\'').next()) else {
        return failure;
    };
    let has = |command: &&clap::Command| {
        command.get_arguments().any(|argument| argument.get_long() == Some(flag))
    };
    let owners: Vec<&str> =
        command.get_subcommands().filter(has).map(clap::Command::get_name).collect();
    if !owners.is_empty() {
        failure.message = format!("--{flag} goes with {} (see --help)", owners.join(", "));
    }
    failure
}

/// The words with `solve` in them if they name no command.
fn with_command<T: Task>(mut words: Vec<OsString>) -> Vec<OsString> {
    let general = ["-h", "--help", "-V", "--version", "help"];
    let command = CommandLine::<T::Args>::command();
    let known = |word: &str| general.contains(&word) || command.find_subcommand(word).is_some();
    let named = words.get(1).and_then(|word| word.to_str()).is_some_and(known);
    if !named {
        words.insert(words.len().min(1), "solve".into());
    }
    words
}
