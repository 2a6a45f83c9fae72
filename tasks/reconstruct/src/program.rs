use std::{ffi::OsString, io::Write, path::Path};

use anyhow::Context;
use clap::Parser;
use softrast_raster::{BackendChoice, RasterBackend, compiled_backends, on_backend};
use softrast_runner::{Error, Failure};

use crate::{
    Checkpoint, Network, Template, Training,
    args::{self, Command, CommandLine, EvaluateArgs, PredictArgs, TrainArgs},
    compare::compare,
    data,
    learner::Learner,
    picture::read_picture,
    score::{mean, predict, score},
    settings::Data,
    shapes::Split,
    train::table,
};

/// Does what a command line asks, the name of the program being its first word.
///
/// Results go to `stdout` and to files, progress and warnings to stderr.
///
/// # Errors
///
/// Everything that should end the program with an error line.
pub fn execute(
    words: impl IntoIterator<Item = OsString>,
    stdout: &mut dyn Write,
) -> Result<(), Failure> {
    let words: Vec<OsString> = words.into_iter().collect();
    let line = match CommandLine::try_parse_from(&words) {
        Ok(line) => line,
        Err(help) if !help.use_stderr() => {
            let text = help.render().to_string();
            return Ok(writeln!(stdout, "{}", text.trim_end()).context(STDOUT)?);
        }
        Err(wrong) => return Err(wrong.into()),
    };
    let again = repeat(&words);
    let said = on_backend!(backend(line.backend.as_deref())?, B => work::<B>(line.command, again))?;
    Ok(writeln!(stdout, "{said}").context(STDOUT)?)
}

const STDOUT: &str = "cannot write to the standard output";

/// The backend that was asked for, set up; of those there are flex is the quickest on a CPU.
fn backend(asked: Option<&str>) -> anyhow::Result<BackendChoice> {
    let asked = asked.or(cfg!(feature = "flex").then_some("flex"));
    let backend = BackendChoice::among(compiled_backends!(), asked)
        .map_err(|error| Error::Usage(error.to_string()))?;
    backend.set_up()?;
    Ok(backend)
}

fn work<B: RasterBackend>(command: Command, again: String) -> anyhow::Result<String> {
    let device = B::Device::default();
    match command {
        Command::Train(args) => train::<B>(&args, again, &device),
        Command::Evaluate(args) => evaluate::<B>(&args, &device),
        Command::Predict(args) => predict_mesh::<B>(&args, &device),
        Command::Compare(args) => compare::<B>(&args, &again, &device),
    }
}

fn train<B: RasterBackend>(
    args: &TrainArgs,
    command: String,
    device: &B::Device,
) -> anyhow::Result<String> {
    let softness = args::softness(&args.softness, args.scale, args.squared)?;
    let training = Training {
        settings: args.common.settings(softness, args.t_conorm),
        epochs: args.common.epochs(),
        out: args.out.clone(),
        resume: args.common.resume,
        visible: !args.common.quiet,
        command,
    };
    let (header, sphere) = training.run::<B>(device)?;
    let iou = header.epochs.last().map(|epoch| epoch.voxel_iou.clone()).unwrap_or_default();
    let page = training.out.join(crate::train::REPORT);
    Ok(format!("{}\nreport: {}", table(&header.classes, &iou, &sphere), page.display()))
}

fn evaluate<B: RasterBackend>(args: &EvaluateArgs, device: &B::Device) -> anyhow::Result<String> {
    let (checkpoint, network) = trained::<B>(&args.checkpoint, device)?;
    let settings = &checkpoint.header.settings;
    let data = args.data.clone().map_or_else(|| settings.data.clone(), Data::Files);
    let shapes = data::open(&data, Split::Test, settings.seed)?;
    let views = [args.shapes, args.views];
    let score = score(&network, &Template::new(device), shapes.as_ref(), views, device)?;
    if args.json {
        let classes = shapes.classes().iter().zip(&score.classes);
        let classes: serde_json::Map<_, _> =
            classes.map(|(name, &iou)| (name.clone(), iou.into())).collect();
        let json = serde_json::json!({
            "voxel_iou": classes,
            "mean": mean(&score.classes),
            "sphere": mean(&score.sphere),
            "pictures": score.pictures.iter().sum::<usize>(),
            "epochs": checkpoint.header.epochs.len() - 1,
        });
        return Ok(json.to_string());
    }
    let pictures: usize = score.pictures.iter().sum();
    Ok(format!("{}\n{pictures} pictures", table(shapes.classes(), &score.classes, &score.sphere)))
}

fn predict_mesh<B: RasterBackend>(
    args: &PredictArgs,
    device: &B::Device,
) -> anyhow::Result<String> {
    let (_, network) = trained::<B>(&args.checkpoint, device)?;
    let picture = read_picture(&args.picture)?;
    let template = Template::new(device);
    let vertices = predict(&network, &template, &[picture], device).remove(0);
    let mesh = softrast_mesh::Mesh::new(vertices, template.faces().to_vec())
        .context("the network gives no mesh: train it anew")?;
    mesh.write_obj(&args.out)?;
    Ok(format!(
        "{} vertices, {} faces: {}",
        template.vertices(),
        mesh.faces().len(),
        args.out.display()
    ))
}

/// The network of a checkpoint.
pub(crate) fn trained<B: RasterBackend>(
    path: &Path,
    device: &B::Device,
) -> anyhow::Result<(Checkpoint, Network<B>)> {
    let mut checkpoint = Checkpoint::load(path)?;
    let records = std::mem::take(&mut checkpoint.records);
    let learner = Learner::<B>::new(&checkpoint.header.settings, device)?;
    let learner = learner
        .with_bytes(records, device)
        .with_context(|| format!("{} cannot be used", path.display()))?;
    let network = learner.network();
    Ok((checkpoint, network))
}

/// The command line that does the same again from the beginning.
fn repeat(words: &[OsString]) -> String {
    let mut command = String::from("cargo run --release -p reconstruct --");
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
