use anyhow::Context;
use serde_json::json;
use softrast_lab::{
    Error, Inputs, OutputFolder, World,
    program::{Output, say},
    report::Table,
};
use softrast_raster::{RasterBackend, TConorm};

use crate::{
    Settings, Split, Template, Training,
    args::{self, CompareArgs},
    data_set,
    learner::trained,
    score::{Score, score, with_mean},
    train::CHECKPOINT,
};

/// The table, for people and programs.
const RESULTS: [&str; 2] = ["compare.md", "compare.json"];
/// Views of each test shape.
const VIEWS: usize = 4;

/// Mean `IoU` of 13 classes of `ShapeNet` in Table 4 of the paper (Wu et al. 2024): context for the
/// table, not the same data, budget or classes.
const PAPER: [(&str, f64); 2] = [("MLP", 0.6076), ("best of 30 renderers for each class", 0.6232)];

/// Trains each method on the same shapes in the same order from the same weights, scores all of
/// them on the same test shapes, and returns the table that is also written to the folder.
///
/// Finished trainings are stored; `--resume` does not repeat them.
///
/// # Errors
///
/// If a method does not exist, or a training fails.
pub(crate) fn compare<B: RasterBackend>(
    args: &CompareArgs,
    command: &str,
    inputs: &Inputs,
    device: &B::Device,
) -> anyhow::Result<Output> {
    let methods =
        args.methods.iter().map(|text| method(text)).collect::<anyhow::Result<Vec<_>>>()?;
    let mut folder = OutputFolder::open(&args.out, "reconstruct compare", inputs)?;
    folder.claim(RESULTS)?;
    let mut rows = Vec::new();
    for (name, softness, t_conorm) in methods {
        let training = Training {
            settings: args.common.settings(softness, t_conorm),
            epochs: args.common.epochs(),
            out: args.out.join(name.replace([':', '+'], "-")),
            resume: args.common.resume,
            visible: !args.common.quiet,
            command: command.to_owned(),
            inputs: inputs.clone(),
        };
        if training.visible {
            say(&name);
        }
        let (header, _) = training.run::<B>(&World::alone(), device)?;
        let (_, network) = trained::<B>(&training.out.join(CHECKPOINT), device)?;
        let shapes = data_set::open(&training.settings.data, Split::Test, training.settings.seed)?;
        let views = [args.test_shapes, VIEWS];
        let score = score(&network, &Template::new(device), shapes.as_ref(), views, device)?;
        let seconds: f64 = header.epochs.iter().map(|epoch| epoch.time.all).sum();
        let (classes, settings) = (header.classes, header.settings);
        rows.push(Row { name, classes, score, minutes: seconds / 60.0, settings });
    }
    let table = markdown(args, &rows, command);
    folder.stage(RESULTS[0], table.as_bytes())?;
    let json: Vec<_> = rows.iter().map(Row::json).collect();
    folder.stage(RESULTS[1], &serde_json::to_vec_pretty(&json)?)?;
    folder.commit()?;
    Ok(Output { json: json!({ "methods": json }), text: vec![table], ..Output::default() })
}

/// Results of a method.
struct Row {
    name: String,
    classes: Vec<String>,
    score: Score,
    minutes: f64,
    settings: Settings,
}

impl Row {
    fn json(&self) -> serde_json::Value {
        json!({
            "method": self.name,
            "classes": self.classes,
            "voxel_iou": self.score.classes,
            "sphere": self.score.sphere,
            "pictures": self.score.pictures,
            "minutes": self.minutes,
        })
    }
}

type Method = (String, (softrast_softness::EdgeSoftness, Vec<f64>), TConorm);

/// A softness and a T-conorm from `softness+t_conorm`.
fn method(text: &str) -> anyhow::Result<Method> {
    let (softness, t_conorm) = text.split_once('+').unwrap_or((text, "probabilistic"));
    let t_conorm = t_conorm.parse::<TConorm>().map_err(|error| Error::Usage(error.to_string()))?;
    let softness =
        softness.parse().map_err(Error::usage).and_then(|s| args::softness(&s, None, false));
    Ok((text.to_owned(), softness.with_context(|| format!("method {text}"))?, t_conorm))
}

/// The table of all methods, and their training settings.
fn markdown(args: &CompareArgs, rows: &[Row], command: &str) -> String {
    let Some(Row { classes, score, settings, .. }) = rows.first() else { return String::new() };
    let classes = classes.iter().map(String::as_str);
    let mut table = Table::new(["voxel IoU"].into_iter().chain(classes).chain(["mean", "minutes"]));
    let mut push = |name: &str, values: &[f64], minutes: String| {
        let cells = with_mean(values).map(|iou| format!("{iou:.3}"));
        table.push([name.to_owned()].into_iter().chain(cells).chain([minutes]));
    };
    push("sphere, not deformed", &score.sphere, String::new());
    for Row { name, score, minutes, .. } in rows {
        push(name, &score.classes, format!("{minutes:.1}"));
    }
    let mut text = format!(
        "{}\n{} epochs of {} steps, {} pairs of pictures each, {} widths, seed {}; {}; test shapes: {} of a \
         class, {VIEWS} views of each. Softness parameters learn beside the network at a rate of {}.\n\n\
         `{command}`\n",
        table.markdown().trim_start(),
        args.common.epochs(),
        settings.steps,
        settings.pairs,
        settings.width.name(),
        settings.seed,
        settings.data,
        args.test_shapes,
        settings.softness_rate,
    );
    for (name, iou) in PAPER {
        text += &format!(
            "\nFor context, not for comparison: {name}, ShapeNet, 250,000 steps of 64 pairs: {iou:.3} (Wu et \
             al. 2024, Table 4).\n"
        );
    }
    text
}
