use std::{ffi::OsString, io::Write, path::PathBuf};

use anyhow::anyhow;
use clap::{CommandFactory, Parser};
use serde_json::json;
use softrast_lab::{
    Error, Failure, Inputs, OutputFolder, Shard, Store,
    parse::count,
    program::{Output, parse, repeated, say},
    shown,
};

use crate::{Case, Matrix, Tested, cases, cases::QUICK, report, run};

/// Files of the results: the page, and the matrix as JSON.
const PAGE: &str = "report.html";
const MATRIX: &str = "stability.json";

/// Tests every softness on scenes where rasterizers and optimisers fail.
#[derive(Debug, Parser)]
#[command(name = "stability", version)]
struct Args {
    /// Cases to run: quick, all, or their names, such as O02,O03
    #[arg(long, value_name = "quick|all|ID,..", default_value = "quick")]
    cases: String,

    /// Softness file to test as mlp, instead of the untrained network
    #[arg(long, value_name = "FILE.json")]
    mlp: Option<PathBuf>,

    /// Methods to test, such as logistic,decay; all six by default
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    methods: Vec<String>,

    /// Folder for the results; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/stability")]
    out: PathBuf,

    /// Cases to run at the same time; all cores by default
    #[arg(long, value_name = "N", value_parser = count)]
    threads: Option<usize>,

    /// Resume from the outcomes of an interrupted call, or of shards
    #[arg(long)]
    resume: bool,

    /// Test only every N-th pair of case and method, from the I-th on, as one of N processes that share the folder; auto takes both numbers
    /// from Slurm or mpirun
    #[arg(long, value_name = "I/N|auto", value_parser = Shard::parse)]
    shard: Option<Shard>,

    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,

    /// Show no progress
    #[arg(long)]
    quiet: bool,
}

/// Executes a command line, whose first word is the name of the program.
///
/// # Errors
///
/// Any error that should end the program with an error line, and, after the results are written and printed, a fault of the program.
pub fn execute(words: Vec<OsString>, stdout: &mut dyn Write) -> Result<(), Failure> {
    let Some(args) = parse::<Args>(Args::command(), &words, stdout)? else { return Ok(()) };
    let again = repeated("stability", &words);
    let matrix = work(&args, &again, &Inputs::of_words(&words, &["--out"]))?;
    if args.shard.is_some() {
        let count: usize = matrix.rows.iter().map(|row| row.outcomes.len()).sum();
        let then = "then: the same command with --resume instead of --shard, for the results of all shards";
        let text = vec![format!("{count} pairs of case and method are finished"), then.to_owned()];
        let json = json!({ "finished": count, "out": shown(&args.out) });
        return Output { json, text, ..Output::default() }.print(args.json, &again, stdout);
    }
    let json = serde_json::to_value(&matrix).map_err(anyhow::Error::from)?;
    let mut text = report::lines(&matrix);
    text.push(format!("report: {}", args.out.join(PAGE).display()));
    Output { json, text, ..Output::default() }.print(args.json, &again, stdout)?;
    match matrix.faults().len() {
        0 => Ok(()),
        count => Err(anyhow!("{count} of the outcomes are faults of the program").into()),
    }
}

fn work(args: &Args, again: &str, inputs: &Inputs) -> anyhow::Result<Matrix> {
    let chosen = chosen(&args.cases)?;
    let methods = methods(args)?;
    let mut folder = OutputFolder::open(&args.out, "stability", inputs)?;
    folder.claim([PAGE, MATRIX])?;
    let (store, note) = Store::of_command(&mut folder, "stability.jsonl", args.shard, args.resume)?;
    note.iter().for_each(|note| say(note));
    // A panic in a case is part of its outcome.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let matrix = run(
        &chosen,
        &methods,
        store,
        args.threads.unwrap_or_else(rayon::current_num_threads),
        args.quiet,
    );
    std::panic::set_hook(hook);
    let matrix = matrix?;
    if args.shard.is_some() {
        return Ok(matrix);
    }
    folder.stage(PAGE, report::html(&matrix, again)?.as_bytes())?;
    folder.stage(MATRIX, &serde_json::to_vec_pretty(&matrix)?)?;
    folder.commit()?;
    Ok(matrix)
}

/// The methods that `--methods` names.
fn methods(args: &Args) -> anyhow::Result<Vec<Tested>> {
    let all = Tested::all(args.mlp.as_deref())?;
    if args.methods.is_empty() {
        return Ok(all);
    }
    let named = |name: &String| {
        all.iter().find(|tested| tested.name == *name).cloned().ok_or_else(|| {
            let known: Vec<&str> = all.iter().map(|tested| tested.name.as_str()).collect();
            Error::usage(format!("there is no method {name:?}; known are {}", known.join(", ")))
        })
    };
    args.methods.iter().map(named).collect()
}

/// The cases that `--cases` names.
///
/// # Errors
///
/// [`Error::Usage`] if there is no case of a name.
pub fn chosen(text: &str) -> Result<Vec<&'static Case>, Error> {
    match text {
        "all" => return Ok(cases().collect()),
        "quick" => return Ok(cases().filter(|case| QUICK.contains(&case.id)).collect()),
        _ => {}
    }
    let named = |id: &str| {
        let id = id.trim();
        let found = cases().find(|case| case.id.eq_ignore_ascii_case(id));
        found.ok_or_else(|| {
            let known: Vec<&str> = cases().map(|case| case.id).collect();
            Error::Usage(format!("there is no case {id:?}; known are {}", known.join(", ")))
        })
    };
    text.split(',').map(named).collect()
}
