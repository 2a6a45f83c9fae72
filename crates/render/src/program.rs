use std::{
    ffi::OsString,
    fs::File,
    io::{Read, Write},
    path::Path,
};

use anyhow::anyhow;
use clap::CommandFactory;
use serde_json::{Value, json};
use softrast_lab::{
    Error, Failure, Inputs, OutputFile, contact_sheet,
    format::counted,
    median, peak_rss_mib, png,
    program::{Output, parse, repeated},
    rgb_from_gray, rgb_from_planes, shown,
};
use softrast_raster::{
    BackendChoice, RasterBackend, compiled_backends, low_level::Rasterizer, on_backend,
};
use softrast_softness::Softness;

use crate::{
    args::Args,
    coloured::Coloured,
    fused::Fused,
    paint::Colour,
    reference,
    scene::{Scene, Step},
};

/// Default number of timed repetitions.
const REPEAT: usize = 5;

/// Executes a command line, whose first word is the name of the program.
///
/// # Errors
///
/// Any error that should end the program with an error line. No picture is written then, unless only `stdout` failed.
pub fn execute(words: Vec<OsString>, stdout: &mut dyn Write) -> Result<(), Failure> {
    let Some(args) = parse::<Args>(Args::command(), &words, stdout)? else { return Ok(()) };
    let inputs = Inputs::of_words(&words, &["--out"]);
    let output = match args.threads {
        None => draw(&args, &inputs),
        Some(threads) => {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|error| anyhow!("--threads {threads}: {error}"))?;
            pool.install(|| draw(&args, &inputs))
        }
    };
    output?.print(args.json, &repeated("render", &words), stdout)
}

/// All passes, and measurements of the fused op.
struct Measured {
    steps: Vec<Step>,
    pairs: Option<usize>,
    culled: Option<f64>,
    prepare_ms: Option<f64>,
    profile: Option<(usize, [f64; 2])>,
}

fn draw(args: &Args, inputs: &Inputs) -> anyhow::Result<Output> {
    let backend = BackendChoice::select(compiled_backends!(), args.backend.as_deref());
    let backend = backend.map_err(|error| Error::usage(error.to_string()))?;
    if !args.reference {
        backend.set_up()?;
    }
    let scene = Scene::load(args)?;
    if args.out.file_name().is_none() || args.out.is_dir() {
        let message = format!("--out {}: expected the name of a picture", args.out.display());
        return Err(Error::usage(message));
    }
    let out = OutputFile::open(&args.out, "PNG picture", is_png, inputs)?;

    let repeat = args.repeat.unwrap_or(if args.reference { 1 } else { REPEAT });
    let base_rss_mib = peak_rss_mib();
    let measured = match &scene.colour {
        _ if args.reference => by_reference(&scene, repeat, args.quiet),
        None => on_backend!(backend, B => by_fused_op::<B>(&scene, repeat)),
        Some(colour) => on_backend!(backend, B => in_colour::<B>(&scene, colour, repeat)),
    };
    let last = &measured.steps[repeat - 1];
    out.write(&png(&picture(&last.image, scene.size, if args.colour { 3 } else { 1 }))?)?;

    let title = if args.reference { reference::BACKEND } else { backend.title() };
    let times =
        |of: &dyn Fn(&Step) -> f64| median(&measured.steps.iter().map(of).collect::<Vec<_>>());
    let backward = |step: &Step| step.backward_ms.unwrap_or(0.0);
    let json = json!({
        "mesh": shown(&args.mesh),
        "faces": scene.faces.len(),
        "views": scene.views(),
        "size": scene.size,
        "softness": scene.softness.family.to_string(),
        "squared": scene.softness.scale_is_squared(),
        "phi": scene.phi,
        "t_conorm": scene.colour.is_none().then(|| scene.t_conorm.to_string()),
        "colour": scene.colour.as_ref().map(|colour| colour.paint.to_string()),
        "shade": scene.colour.as_ref().map(|colour| colour.shade),
        "samples": scene.colour.as_ref().map(|colour| colour.samples),
        "tolerance": scene.tolerance,
        "backend": title,
        "threads": rayon::current_num_threads(),
        "repeat": repeat,
        "pairs": measured.pairs,
        "culled_by_tolerance": measured.culled,
        "mean_alpha": last.mean_alpha,
        "loss": last.loss.map(|[loss, _]| loss),
        "gradient_norm": last.loss.map(|[_, norm]| norm),
        "forward_ms": times(&|step| step.forward_ms),
        "backward_ms": last.backward_ms.map(|_| times(&backward)),
        "total_ms": times(&|step| step.forward_ms + backward(step)),
        "prepare_ms": measured.prepare_ms,
        "base_rss_mib": base_rss_mib,
        "peak_rss_mib": peak_rss_mib(),
        "profile_knots": measured.profile.map(|(knots, _)| knots),
        "support_ndc": measured.profile.map(|(_, support)| support),
        "out": shown(&args.out),
    });
    let culled = measured.culled.filter(|&culled| culled > 0.5).map(|culled| {
        format!(
            "--tolerance {} culls {:.0} % of the pairs that the default {:e} keeps: faces get no gradient from pixels that they still \
             cover a little; try a smaller one",
            scene.tolerance,
            100.0 * culled,
            Rasterizer::TOLERANCE
        )
    });
    let text = lines(&json);
    let warnings = culled.into_iter().chain(scene.warnings).collect();
    Ok(Output { json, text, warnings, partial: None })
}

/// Whether a file begins with the PNG signature.
fn is_png(path: &Path) -> bool {
    let mut head = [0; 8];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head == *b"\x89PNG\r\n\x1a\n"
}

fn by_reference(scene: &Scene, repeat: usize, quiet: bool) -> Measured {
    let steps = (0..repeat).map(|_| reference::step(scene, quiet)).collect();
    let pairs = scene.views() * scene.size * scene.size * scene.faces.len();
    Measured { steps, pairs: Some(pairs), culled: None, prepare_ms: None, profile: None }
}

/// Measures `repeat` passes, after one to warm up.
fn in_colour<B: RasterBackend>(scene: &Scene, colour: &Colour, repeat: usize) -> Measured {
    let coloured = Coloured::<B>::new(scene, colour);
    let steps = (0..=repeat).map(|_| coloured.step()).skip(1).collect();
    Measured { steps, pairs: None, culled: None, prepare_ms: None, profile: None }
}

/// Measures `repeat` passes, after one to warm up.
fn by_fused_op<B: RasterBackend>(scene: &Scene, repeat: usize) -> Measured {
    let fused = Fused::<B>::new(scene);
    let steps = (0..=repeat).map(|_| fused.step()).skip(1).collect();
    let (pairs, culled) = fused.pairs(scene);
    let prepare_ms = Some(fused.prepare_ms);
    let profile = Some(fused.profile());
    Measured { steps, pairs: Some(pairs), culled: Some(culled), prepare_ms, profile }
}

/// The results as lines of text.
fn lines(json: &Value) -> Vec<String> {
    let number = |key: &str| json[key].as_f64();
    let count = |key: &str| json[key].as_u64().unwrap_or(0) as usize;
    let text = |key: &str| json[key].as_str().unwrap_or_default();
    let (size, views) = (count("size"), count("views"));
    let squared = if json["squared"] == true { " of the squared distance" } else { "" };
    let softness = format!("{}{squared}", text("softness"));
    let image = format!("{} of {size} x {size} pixels", counted(views, "view"));
    let mut lines = vec![("mesh", format!("{}, {} faces", text("mesh"), count("faces")))];
    if json["colour"].is_null() {
        lines.push(("image", image));
        lines.push(("softness", format!("{softness}, joined by {}", text("t_conorm"))));
    } else {
        let samples = count("samples");
        let light = if json["shade"] == true { ", lit from the camera" } else { "" };
        lines.push(("image", format!("{image}, {samples} x {samples} samples each")));
        lines.push(("colour", format!("{}{light}", text("colour"))));
        lines.push(("softness", softness));
    }
    let support = [0, 1].map(|k| json["support_ndc"][k].as_f64());
    if let [Some(outside), Some(inside)] = support.map(|ndc| Some(ndc? * size as f64 / 2.0)) {
        let knots = count("profile_knots");
        let value =
            format!("{knots} knots, {outside:.2} px outside to {inside:.2} px inside an edge");
        lines.push(("profile", value));
    }
    if let Some(pairs) = number("pairs") {
        let share = 100.0 * pairs / (views * size * size * count("faces")) as f64;
        lines.push(("pairs", format!("{pairs} visited, {share:.3} % of all")));
    }
    lines.extend(number("mean_alpha").map(|mean| ("mean alpha", format!("{mean:.7}"))));
    if let (Some(loss), Some(norm)) = (number("loss"), number("gradient_norm")) {
        lines.push(("loss", format!("{loss:.7}, gradient norm {norm:.7}")));
    }
    let [forward, total] = ["forward_ms", "total_ms"].map(|key| number(key).unwrap_or(f64::NAN));
    let time = match number("backward_ms") {
        Some(backward) => {
            format!("{forward:.3} ms forward + {backward:.3} ms backward = {total:.3} ms")
        }
        None => format!("{forward:.3} ms forward"),
    };
    let (repeat, threads) = (count("repeat"), counted(count("threads"), "thread"));
    let how = format!("{time} (median of {repeat}), {} on {threads}", text("backend"));
    lines.push(("time", how));
    if let (Some(peak), Some(base)) = (number("peak_rss_mib"), number("base_rss_mib")) {
        let grown = peak - base;
        lines.push(("memory", format!("{peak:.1} MiB at most, {grown:.1} for drawing")));
    }
    lines.push(("picture", text("out").to_owned()));
    lines.into_iter().map(|(name, value)| format!("{name:<12}{value}")).collect()
}

/// The views `[views, channels, size, size]`, of one or three channels, as one picture: the only view, or else a contact sheet.
fn picture(image: &[f64], size: usize, channels: usize) -> image::RgbImage {
    let drawn = |view: &[f64]| match channels {
        1 => rgb_from_gray(view, size, size),
        _ => rgb_from_planes(view, size, size),
    };
    let views: Vec<_> = image.chunks_exact(channels * size * size).map(drawn).collect();
    match &views[..] {
        [view] => view.clone(),
        views => contact_sheet(views, columns(views.len())),
    }
}

/// Columns of a sheet that is wider than high, without empty cells if possible.
fn columns(views: usize) -> usize {
    let root = views.isqrt() + usize::from(views.isqrt().pow(2) < views);
    (root..=2 * root).find(|columns| views.is_multiple_of(*columns)).unwrap_or(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_is_wide_and_full() {
        let expected = [(1, 1), (2, 2), (4, 2), (5, 5), (7, 3), (8, 4), (24, 6), (36, 6)];
        for (views, expected) in expected {
            assert_eq!(columns(views), expected, "{views} views");
        }
    }
}
