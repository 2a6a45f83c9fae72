use std::{
    ffi::OsString,
    fs,
    io::{self, Write},
    path::PathBuf,
    process::ExitCode,
    time::Instant,
};

use anyhow::Context;
use clap::Parser;
use softrast_runner::{Error, Failure};

use crate::{Case, Matrix, Tested, cases, report, run};

/// Tests every softness on scenes where rasterizers and optimisers fail.
#[derive(Debug, Parser)]
#[command(name = "stability", version)]
struct Args {
    /// Cases to run: quick, all, or their names, such as F02,O03.
    #[arg(long, value_name = "quick|all|ID,..", default_value = "quick")]
    cases: String,

    /// Softness file to test as mlp, instead of the network that has not been trained.
    #[arg(long, value_name = "FILE.json")]
    mlp: Option<PathBuf>,

    /// Methods to test, such as logistic,decay; all six by default.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    methods: Vec<String>,

    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR", default_value = "out/stability")]
    out: PathBuf,

    /// Cases to run at the same time; all cores by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,

    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,

    /// Show no progress.
    #[arg(long)]
    quiet: bool,
}

/// The whole `main` of the program.
pub fn main() -> ExitCode {
    // A panic in a case is part of its outcome.
    std::panic::set_hook(Box::new(|_| {}));
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
/// Everything that should end the program with an error line; also, after the results are written
/// and printed, that something is broken.
pub fn execute(
    words: impl IntoIterator<Item = OsString>,
    stdout: &mut dyn Write,
) -> Result<(), Failure> {
    const STDOUT: &str = "cannot write to the standard output";
    let words: Vec<OsString> = words.into_iter().collect();
    let args = match Args::try_parse_from(&words) {
        Ok(args) => args,
        Err(help) if !help.use_stderr() => {
            let text = help.render().to_string();
            return Ok(writeln!(stdout, "{}", text.trim_end()).context(STDOUT)?);
        }
        Err(wrong) => return Err(wrong.into()),
    };
    let matrix = work(&args)?;
    let shown = match args.json {
        true => serde_json::to_string(&matrix).context("cannot write the results as JSON")?,
        false => format!("{}\nreport: {}", matrix.text(), args.out.join("report.html").display()),
    };
    writeln!(stdout, "{shown}").context(STDOUT)?;
    match matrix.faults().len() {
        0 => Ok(()),
        count => Err(anyhow::anyhow!("{count} of the outcomes are faults of the program").into()),
    }
}

fn work(args: &Args) -> anyhow::Result<Matrix> {
    let chosen = chosen(&args.cases)?;
    let refused = || format!("cannot write to the folder {}", args.out.display());
    fs::create_dir_all(&args.out).with_context(refused)?;
    let methods = methods(args)?;
    if args.mlp.is_some() {
        // Refused here rather than in every case.
        methods.iter().try_for_each(|method| method.method_at(0.1).map(drop))?;
    }
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = args.threads.map_or(cores, usize::from);
    let clock = Instant::now();
    let outcomes = run(&chosen, &methods, threads, args.quiet);
    let matrix = Matrix::new(&chosen, &methods, outcomes, clock.elapsed().as_secs_f64());
    let page = report::html(&matrix, &again(args))?;
    fs::write(args.out.join("report.html"), page).with_context(refused)?;
    let json = serde_json::to_vec_pretty(&matrix)?;
    fs::write(args.out.join("stability.json"), json).with_context(refused)?;
    Ok(matrix)
}

/// The methods that `--methods` names.
fn methods(args: &Args) -> anyhow::Result<Vec<Tested>> {
    let all = Tested::all(args.mlp.clone());
    if args.methods.is_empty() {
        return Ok(all);
    }
    let named = |name: &String| {
        all.iter().find(|tested| tested.name == name).cloned().ok_or_else(|| {
            let known: Vec<&str> = all.iter().map(|tested| tested.name).collect();
            Error::Usage(format!("there is no method {name:?}; known are {}", known.join(", ")))
                .into()
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
        "quick" => return Ok(cases().filter(|case| case.quick).collect()),
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

fn again(args: &Args) -> String {
    let mut line = format!("cargo run --release -p stability -- --cases {}", args.cases);
    if !args.methods.is_empty() {
        line += &format!(" --methods {}", args.methods.join(","));
    }
    if let Some(file) = &args.mlp {
        line += &format!(" --mlp {}", file.display());
    }
    line
}
