use std::{ffi::OsString, io::Write, path::Path};

use anyhow::{Context, ensure};
use clap::CommandFactory;
use image::{ImageReader, imageops};
use serde_json::json;
use softrast_lab::{
    Error, Failure, INTERRUPTED, Inputs, OutputFile, World, mean,
    program::{Output, parse, repeated, say},
    shown,
};
use softrast_mesh::Mesh;
use softrast_raster::{BackendChoice, RasterBackend, compiled_backends, on_backend};

use crate::{
    Data, SIZE, Split, Template, Training,
    args::{self, Command, CommandLine, EvaluateArgs, PredictArgs, TrainArgs},
    compare::compare,
    data_set,
    learner::trained,
    score::{predict, score},
    train::table,
};

/// Runs a command line; its first word is the name of the program.
///
/// Results go to `stdout` and to files, progress and warnings to stderr.
///
/// # Errors
///
/// Every error that ends the program with an error line.
pub fn execute(words: Vec<OsString>, stdout: &mut dyn Write) -> Result<(), Failure> {
    let Some(line) = parse::<CommandLine>(CommandLine::command(), &words, stdout)? else {
        return Ok(());
    };
    let again = repeated("reconstruct", &words);
    let backend = backend(line.backend.as_deref())?;
    let inputs = Inputs::of_words(&words, &["--out"]);
    let output = on_backend!(backend, B => work::<B>(line.command, again.clone(), inputs.clone()))
        .map_err(|error| stopped(error, &again))?;
    output.map_or(Ok(()), |output| output.print(line.json, &again, stdout))
}

/// The epochs before a stop by the user are stored.
fn stopped(error: anyhow::Error, again: &str) -> Failure {
    let failure = Failure::from(error);
    match failure.code {
        INTERRUPTED => Failure {
            message: format!(
                "stopped amid an epoch; go on from the one before with: {again} --resume"
            ),
            ..failure
        },
        _ => failure,
    }
}

/// The requested backend, initialized; by default flex, the fastest on a CPU, if available.
fn backend(asked: Option<&str>) -> anyhow::Result<BackendChoice> {
    let asked = asked.or(cfg!(feature = "flex").then_some("flex"));
    let backend = BackendChoice::select(compiled_backends!(), asked)
        .map_err(|error| Error::Usage(error.to_string()))?;
    backend.set_up()?;
    Ok(backend)
}

fn work<B: RasterBackend>(
    command: Command,
    again: String,
    inputs: Inputs,
) -> anyhow::Result<Option<Output>> {
    let device = B::Device::default();
    match command {
        Command::Train(args) => train::<B>(&args, again, inputs, &device),
        Command::Evaluate(args) => evaluate::<B>(&args, &device).map(Some),
        Command::Predict(args) => predict_mesh::<B>(&args, inputs, &device).map(Some),
        Command::Compare(args) => compare::<B>(&args, &again, &inputs, &device).map(Some),
    }
}

/// Trains, together with the other processes of `mpirun`; only the first of them prints.
fn train<B: RasterBackend>(
    args: &TrainArgs,
    command: String,
    inputs: Inputs,
    device: &B::Device,
) -> anyhow::Result<Option<Output>> {
    let softness = args::softness(&args.softness, args.scale, args.squared)?;
    let training = Training {
        settings: args.common.settings(softness, args.t_conorm),
        epochs: args.common.epochs(),
        out: args.out.clone(),
        resume: args.common.resume,
        visible: !args.common.quiet,
        command,
        inputs,
    };
    let world = World::join()?;
    let trained = training.run::<B>(&world, device);
    let (header, sphere) = trained.map_err(|error| world.fail(error))?;
    if !world.is_first() {
        return Ok(None);
    }
    let iou = header.epochs.last().map(|epoch| epoch.voxel_iou.clone()).unwrap_or_default();
    let page = training.out.join(crate::train::REPORT);
    let text = vec![table(&header.classes, &iou, &sphere), format!("report: {}", page.display())];
    let json = json!({
        "voxel_iou": by_class(&header.classes, &iou),
        "mean": mean(&iou),
        "sphere": mean(&sphere),
        "epochs": header.epochs.len() - 1,
        "report": shown(&page),
    });
    Ok(Some(Output { json, text, ..Output::default() }))
}

fn evaluate<B: RasterBackend>(args: &EvaluateArgs, device: &B::Device) -> anyhow::Result<Output> {
    let (checkpoint, network) = trained::<B>(&args.checkpoint, device)?;
    let settings = &checkpoint.header.settings;
    let data = args.data.clone().map_or_else(|| settings.data.clone(), Data::Files);
    let shapes = data_set::open(&data, Split::Test, settings.seed)?;
    let views = [args.shapes, args.views];
    let score = score(&network, &Template::new(device), shapes.as_ref(), views, device)?;
    let pictures: usize = score.pictures.iter().sum();
    let json = json!({
        "voxel_iou": by_class(shapes.classes(), &score.classes),
        "mean": mean(&score.classes),
        "sphere": mean(&score.sphere),
        "pictures": pictures,
        "epochs": checkpoint.header.epochs.len() - 1,
    });
    let text = vec![
        table(shapes.classes(), &score.classes, &score.sphere),
        format!("{pictures} pictures"),
    ];
    Ok(Output { json, text, ..Output::default() })
}

/// Voxel `IoU` by class name.
fn by_class(classes: &[String], iou: &[f64]) -> serde_json::Map<String, serde_json::Value> {
    classes.iter().zip(iou).map(|(name, &iou)| (name.clone(), iou.into())).collect()
}

fn predict_mesh<B: RasterBackend>(
    args: &PredictArgs,
    mut inputs: Inputs,
    device: &B::Device,
) -> anyhow::Result<Output> {
    inputs.add(&args.checkpoint);
    let write = Mesh::writer(&args.out)?;
    let out = OutputFile::open(&args.out, "mesh", |path| Mesh::load(path).is_ok(), &inputs)?;
    let (_, network) = trained::<B>(&args.checkpoint, device)?;
    let picture = read_picture(&args.picture)?;
    let template = Template::new(device);
    let vertices = predict(&network, &template, &[picture], device).remove(0);
    let mesh = Mesh::new(vertices, template.faces().to_vec())
        .context("the network gives no mesh: train it anew")?;
    out.write(&write(&mesh))?;
    let [vertices, faces] = [template.vertices(), mesh.faces().len()];
    let text = vec![format!("{vertices} vertices, {faces} faces: {}", args.out.display())];
    let json = json!({ "vertices": vertices, "faces": faces, "mesh": shown(&args.out) });
    Ok(Output { json, text, ..Output::default() })
}

/// A picture file as input of the network: planes of red, green, blue and alpha, `[4 * 64 * 64]`.
///
/// Other sizes than 64×64 pixels are scaled. Colours are multiplied by alpha, because the
/// background of training pictures is black.
///
/// # Errors
///
/// If the file is no picture, not square, or empty: alpha 0 everywhere.
fn read_picture(path: &Path) -> anyhow::Result<Vec<u8>> {
    let name = path.display();
    let reader = ImageReader::open(path).with_context(|| format!("cannot read {name}"))?;
    let reader = reader.with_guessed_format().with_context(|| format!("cannot read {name}"))?;
    let image = reader.decode().with_context(|| format!("{name} is no PNG picture"))?;
    let (width, height) = (image.width(), image.height());
    ensure!(width == height, "{name} is {width} x {height} pixels, expected a square");
    if !image.color().has_alpha() {
        say(&format!(
            "warning: {name} has no alpha, so all of it counts as the object; the network expects \
             alpha 0 around it"
        ));
    }
    let mut image = image.to_rgba8();
    if width as usize != SIZE {
        let side = SIZE as u32;
        image = imageops::resize(&image, side, side, imageops::FilterType::Triangle);
    }
    ensure!(image.pixels().any(|p| p.0[3] > 0), "{name} shows nothing: its alpha is 0 everywhere");
    let level = |p: &image::Rgba<u8>, k: usize| match k {
        3 => p.0[3],
        k => (u16::from(p.0[k]) * u16::from(p.0[3]) / 255) as u8,
    };
    Ok((0..4).flat_map(|k| image.pixels().map(move |p| level(p, k))).collect())
}
