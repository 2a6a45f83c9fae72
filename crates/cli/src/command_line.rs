//! The commands of a task and their flags.

use clap::{Args, Parser, Subcommand};
use softrast_lab::{
    Shard,
    parse::{count, positive},
};

use crate::{Common, EXPERIMENTS, MethodArgs, learn_args::LearnArgs};

/// Everything on the command line of a task.
#[derive(Debug, Parser)]
#[command(subcommand_required = true)]
pub(crate) struct CommandLine<A: Args, P: Args> {
    #[command(subcommand)]
    pub(crate) command: Command<A, P>,
}

/// The commands of a program; `solve` by default.
#[derive(Clone, Debug, Subcommand)]
pub(crate) enum Command<A: Args, P: Args> {
    /// Solve one instance and show the result; the default command
    Solve(Box<Solve<A, P>>),
    /// Solve many seeds and report means with confidence intervals
    Evaluate(Evaluate<A>),
    /// Find the best scales, surrogate and learning rate on training seeds, then evaluate them on others
    Search(Search<A>),
    /// Find the simplest softness, the fewest pixels, the largest tolerance and the coarsest mesh that are as good as the best
    Choose(Choose<A>),
    /// Learn the softness on training seeds, by the gradient of the outer loss of whole runs
    Learn(Learn<A>),
}

impl<A: Args, P: Args> Command<A, P> {
    /// Name of the command, and the shared flags.
    pub(crate) fn shared(&self) -> (&'static str, &Shared<A>) {
        match self {
            Self::Solve(solve) => ("solve", &solve.shared),
            Self::Evaluate(Evaluate { shared, .. }) => ("evaluate", shared),
            Self::Search(Search { shared, .. }) => ("search", shared),
            Self::Choose(Choose { shared, .. }) => ("choose", shared),
            Self::Learn(Learn { shared, .. }) => ("learn", shared),
        }
    }
}

/// The flags of every command.
#[derive(Args, Clone, Debug)]
pub(crate) struct Shared<A: Args> {
    #[command(flatten)]
    pub(crate) args: A,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) common: Common,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct Solve<A: Args, P: Args> {
    #[command(flatten)]
    pub(crate) pictures: P,
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
    /// Second method for the same seeds, with its own flags in quotes: "gauss --scale 0.01"
    #[arg(long, value_name = "NAME|FILE.json", value_parser = MethodArgs::parse, alias = "against")]
    pub(crate) baseline: Option<MethodArgs>,
    #[command(flatten)]
    pub(crate) kept: Kept,
    #[command(flatten)]
    pub(crate) auto: Auto,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct Search<A: Args> {
    #[command(flatten)]
    pub(crate) shared: Shared<A>,
    /// Number of held-out seeds to evaluate the result on
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub(crate) runs: Option<usize>,
    /// Most runs of the search (inner loops)
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 400, allow_negative_numbers = true)]
    pub(crate) loops: usize,
    /// Smallest and largest scale to try
    #[arg(long, value_name = "X,X", value_delimiter = ',', value_parser = positive)]
    pub(crate) scales: Vec<f64>,
    /// Smallest and largest learning rate to try
    #[arg(long, value_name = "X,X", value_delimiter = ',', value_parser = positive)]
    pub(crate) learning_rates: Vec<f64>,
    /// Try no surrogate gradients
    #[arg(long, conflicts_with = "surrogate_scale")]
    pub(crate) no_surrogate: bool,
    #[command(flatten)]
    pub(crate) training: Training,
    #[command(flatten)]
    pub(crate) kept: Kept,
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
    pub(crate) kept: Kept,
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

/// Limits of the automatic choice of a method.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Auto {
    /// Seconds for choosing a method [default: no limit]
    #[arg(long, value_name = "SECONDS", value_parser = positive, help_heading = EXPERIMENTS)]
    pub(crate) budget: Option<f64>,
}

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Training {
    /// Training seeds, counted from 1000000, to compare answers, or the last settings of a search, on
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 8, allow_negative_numbers = true)]
    pub(crate) search_runs: usize,
}

/// Reuse of earlier calls, and the share of the runs to make.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct Kept {
    /// Continue from the finished runs of an interrupted call, or of shards
    #[arg(long)]
    pub(crate) resume: bool,
    /// Make only every N-th run, from the I-th on, as one of N processes that share the output
    /// folder; auto reads both numbers from Slurm or mpirun
    #[arg(long, value_name = "I/N|auto", value_parser = Shard::parse)]
    pub(crate) shard: Option<Shard>,
}

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Resume {
    /// Continue from the checkpoint of an interrupted call
    #[arg(long)]
    pub(crate) resume: bool,
}
