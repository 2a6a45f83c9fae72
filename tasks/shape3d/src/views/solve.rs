use std::{cell::RefCell, ffi::OsString, path::PathBuf, sync::Arc};

use anyhow::{anyhow, ensure};
use clap::ValueEnum;
use softrast_cli::{Answer, Given, MaskFlags};
use softrast_inverse::{
    Method, ScheduledSoftness, SolveConfig, baked, minimize, silhouette_pixels,
};
use softrast_lab::{Error, Progress, format::counted};
use softrast_mesh::{Mesh, icosphere};
use softrast_raster::on_backend;
use softrast_softness::{EdgeSoftness, Family};
use softrast_views::{
    CameraFile, PaintedView, View, frame_of_masks, mask_iou, reading_notes, visual_hull,
};

use super::{
    answer::{Scored, answer, names},
    painted::{self, Colours},
    problem::FromViews,
};
use crate::Args;

/// A part of the work.
#[derive(Clone, Copy)]
struct Stage {
    steps: usize,
    /// Pixels a side.
    size: usize,
    learning_rate: f64,
    /// Whether the softness is so narrow that small faces do not widen the outline, or what was learned for spheres.
    narrow: bool,
    /// Whether the mesh has four times as many faces as before.
    finer: bool,
}

/// From a sphere to about the right shape.
const ROUGH: [Stage; 2] = [
    Stage { steps: 80, size: 64, learning_rate: 0.01, narrow: false, finer: false },
    Stage { steps: 60, size: 128, learning_rate: 0.004, narrow: false, finer: true },
];
/// From about the right shape on.
const FINE: [Stage; 2] = [
    Stage { steps: 80, size: 64, learning_rate: 0.004, narrow: true, finer: false },
    Stage { steps: 60, size: 128, learning_rate: 0.003, narrow: true, finer: false },
];
/// Scale of a logistic that is narrow, in NDC of what is looked at. On spot from 20 views the mean `IoU` on 4 others was 0.981 with it,
/// 0.979 with half, 0.976 with one and a half and 0.962 with what was learned for spheres. Spot is the one mesh that it was chosen on.
const NARROW: f64 = 0.001;
/// Cells of the visual hull along its longest side, from few to many: thin parts need more of them.
const CELLS: [usize; 3] = [32, 45, 64];
/// More cells are worth their time if the mean `IoU` of the hull grows by so much.
const GROWS: f64 = 0.01;
/// A mean `IoU` from which a finer mesh is not worth its time.
const RESTART_ABOVE: f64 = 0.995;

/// Pictures and the cameras that took them.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Views {
    /// Folder with pictures and their cameras: transforms.json (instant-ngp, nerfstudio), a model of COLMAP (also in sparse/0 or colmap), or `transforms_train.json`. Masks are transparency, files that it names, or those of --masks
    #[arg(long, value_name = "DIR")]
    pub views: Option<PathBuf>,

    /// Views on which the result is scored, and which the search does not see: a number of those in the folder, evenly spaced, or another file of cameras in
    /// the same world, such as `transforms_test.json`
    #[arg(long, value_name = "N|FILE", requires = "views")]
    pub hold_out: Option<HoldOut>,

    /// What is deformed: the visual hull of the masks, or a sphere, which has no holes [default: hull]
    #[arg(long, value_enum, requires = "views", conflicts_with = "template")]
    pub start: Option<Begin>,

    /// Look for colours too: the mesh gets those of the pictures at its vertices. With --mesh the shape is known, in the world units of the cameras, and stays
    #[arg(long)]
    pub colour: bool,

    /// How smooth the surface is kept, against the usual
    #[arg(long, value_name = "FACTOR", requires = "views", value_parser = softrast_lab::parse::positive, allow_negative_numbers = true)]
    pub smooth: Option<f64>,

    /// How pictures become masks.
    #[command(flatten)]
    pub masks: MaskFlags,
}

/// Views on which a result is scored, and which the search does not see.
#[derive(Clone, Debug)]
pub enum HoldOut {
    /// This many of the folder's views, evenly spaced.
    Count(usize),
    /// All views of another file of cameras.
    Cameras(PathBuf),
}

impl From<OsString> for HoldOut {
    fn from(text: OsString) -> Self {
        match text.to_str().and_then(|text| text.parse().ok()) {
            Some(count) => Self::Count(count),
            None => Self::Cameras(text.into()),
        }
    }
}

/// What is deformed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Begin {
    /// All that no mask rules out.
    #[default]
    Hull,
    /// A sphere around it.
    Sphere,
}

/// The mesh that has the silhouettes of a folder's masks, if the flags name one.
pub(crate) fn solve_views(
    given: &Given<'_, Args>,
    flags: &Views,
) -> Option<anyhow::Result<Answer>> {
    if flags.views.is_none() && flags.colour {
        return Some(Err(Error::usage(
            "--colour takes the colours of pictures: name a folder of them with --views",
        )));
    }
    if flags.views.is_none() && flags.masks.asked() {
        return Some(Err(Error::usage(
            "--masks, --invert, --threshold and --label are about pictures: name a folder of them with --views",
        )));
    }
    flags.views.as_ref().map(|folder| solved(given, flags, folder))
}

fn solved(given: &Given<'_, Args>, flags: &Views, folder: &PathBuf) -> anyhow::Result<Answer> {
    let args = given.args;
    if args.elevation.is_some() || (args.mesh.is_some() && !flags.colour) {
        return Err(Error::usage(
            "--mesh and --elevation say what is drawn as a target: leave them out with --views (--colour takes a --mesh whose colours are \
             looked for)",
        ));
    }
    let deforms = args.template.is_some() || flags.start.is_some() || flags.smooth.is_some();
    if args.mesh.is_some() && deforms {
        return Err(Error::usage(
            "--template, --start and --smooth say how a shape is found: leave them out where --mesh says what it is",
        ));
    }
    if args.detail.is_some() && flags.start != Some(Begin::Sphere) {
        return Err(Error::usage(
            "--detail is about a sphere: with --views it goes with --start sphere",
        ));
    }
    let cameras = CameraFile::load(folder)?;
    let test = match &flags.hold_out {
        Some(HoldOut::Cameras(file)) => Some(CameraFile::load(file)?),
        _ => None,
    };
    let reads = RefCell::new(Vec::new());
    let read = |cameras: &CameraFile| {
        reads.borrow_mut().extend_from_slice(cameras.files());
        cameras.views(flags.masks.masks.as_deref(), |path| {
            reads.borrow_mut().push(path.to_owned());
            flags.masks.load(path)
        })
    };
    let (all, apart) = (read(&cameras)?, test.as_ref().map(read).transpose()?);
    let loaded = || [Some(&all), apart.as_ref()].into_iter().flatten();
    let pictures = loaded().flatten().map(|view| view.picture.clone());
    given.will_write(names(flags.colour), reads.into_inner().into_iter().chain(pictures))?;
    let note = cameras.note().map(str::to_owned);
    let notes = note.into_iter().chain(loaded().flat_map(|views| reading_notes(views)));
    let notes: Vec<String> = notes.collect();
    // What is wrong with a picture is said before the work.
    let paint = |views: &[View]| {
        let painted = views.iter().filter(|_| flags.colour).map(PaintedView::load);
        painted.collect::<anyhow::Result<Vec<_>>>()
    };
    let count = if let Some(HoldOut::Count(count)) = flags.hold_out { count } else { 0 };
    let [train, held_out] = split_held_out(all, count)?;
    let parts = [train, apart.unwrap_or(held_out)];
    let [to_paint, to_compare] = [paint(&parts[0])?, paint(&parts[1])?];
    let [train, held_out] = parts;
    let clock = std::time::Instant::now();
    let stages = stages(given, flags);
    let of_colours = if flags.colour { painted::config(given).steps } else { 0 };
    let steps = stages.iter().map(|stage| stage.steps).sum::<usize>() + of_colours;
    let mut progress = given.progress(steps)?;
    let mut mesh = match &args.mesh {
        Some(path) => Mesh::load(path)?,
        None => {
            let frame = frame_of_masks(&train)?;
            let framed = |view: &View| View { camera: frame.camera(&view.camera), ..view.clone() };
            let views: Vec<View> = train.iter().map(framed).collect();
            let start = start(given, flags, &views)?;
            let found = deformed(given, flags, &stages, start, &views, &mut progress)?;
            frame.mesh_to_world(&found)?
        }
    };
    let mut textured = None;
    if flags.colour {
        let painted = painted::painted(given, &mesh, &to_paint, |step, loss| {
            progress.step(steps - of_colours + step, loss)
        })?;
        textured = Some(baked(&mesh, &painted)?);
        mesh = painted;
    }
    progress.finish();
    let seconds = clock.elapsed().as_secs_f64();
    let score = |(k, view): (usize, &View), painted: &[PaintedView], held_out: bool| {
        let silhouette = silhouette_pixels(&mesh, &view.camera);
        let iou = mask_iou(&silhouette, &view.mask);
        let colours = painted.get(k).map(|view| Colours::new(view, &mesh));
        Scored { view: view.clone(), silhouette, iou, colours, held_out }
    };
    let train = train.iter().enumerate().map(|view| score(view, &to_paint, false));
    let held_out = held_out.iter().enumerate().map(|view| score(view, &to_compare, true));
    let scored: Vec<Scored> = train.chain(held_out).collect();
    answer(given, &mesh, textured.as_ref(), &scored, notes, seconds)
}

/// Parts of the work on the shape, with the steps that were asked for; none if it is known.
fn stages(given: &Given<'_, Args>, flags: &Views) -> Vec<Stage> {
    let args = given.args;
    let from_hull = args.template.is_none() && flags.start.unwrap_or_default() == Begin::Hull;
    let stages: Vec<Stage> = match (args.mesh.is_some(), from_hull) {
        (true, _) => Vec::new(),
        (false, true) => FINE.to_vec(),
        (false, false) => ROUGH.into_iter().chain([FINE[1]]).collect(),
    };
    let with_steps =
        |stage: Stage| Stage { steps: given.common.steps.unwrap_or(stage.steps), ..stage };
    stages.into_iter().map(with_steps).collect()
}

/// Views to work with, and so many evenly spaced ones that are kept aside.
fn split_held_out(all: Vec<View>, hold_out: usize) -> anyhow::Result<[Vec<View>; 2]> {
    let count = all.len();
    ensure!(
        count >= 2,
        "there is one view only: the shape of a mesh takes two or more, from different directions"
    );
    ensure!(
        hold_out <= count - 2,
        "--hold-out {hold_out} leaves fewer than two of {} to work with",
        counted(count, "view")
    );
    let aside: Vec<usize> = (0..hold_out).map(|k| (2 * k + 1) * count / (2 * hold_out)).collect();
    let (aside, train): (Vec<_>, Vec<_>) =
        all.into_iter().enumerate().partition(|(k, _)| aside.contains(k));
    Ok([train, aside].map(|part| part.into_iter().map(|(_, view)| view).collect()))
}

/// The mesh that is deformed, for views of a frame.
fn start(given: &Given<'_, Args>, flags: &Views, views: &[View]) -> anyhow::Result<Mesh> {
    let placed = |mesh: Mesh, size: f64| {
        let place = |p: &[f64; 3]| p.map(|x| size * x);
        anyhow::Ok(mesh.with_positions(mesh.positions().iter().map(place).collect())?)
    };
    match (&given.args.template, flags.start.unwrap_or_default()) {
        (Some(path), _) => placed(Mesh::load(path)?.normalized(), 0.7),
        (None, Begin::Sphere) => placed(icosphere(given.args.detail.unwrap_or(3) as u32), 0.6),
        (None, Begin::Hull) => fitting_hull(views),
    }
}

/// The visual hull in as few cells as show what the masks show.
fn fitting_hull(views: &[View]) -> anyhow::Result<Mesh> {
    let with = |cells: usize| {
        let hull = visual_hull(views, cells);
        let hull =
            hull.map_err(|why| anyhow!("{why:#} (--invert?); --start sphere needs no hull"))?;
        let iou = |view: &View| mask_iou(&silhouette_pixels(&hull, &view.camera), &view.mask);
        let mean = views.iter().map(iou).sum::<f64>() / views.len() as f64;
        anyhow::Ok((hull, mean))
    };
    let (mut mesh, mut iou) = with(CELLS[0])?;
    for cells in &CELLS[1..] {
        let (finer, better) = with(*cells)?;
        if better < iou + GROWS {
            break;
        }
        (mesh, iou) = (finer, better);
    }
    Ok(mesh)
}

/// The start after all stages, for views of a frame: of each the best by its hard images.
fn deformed(
    given: &Given<'_, Args>,
    flags: &Views,
    stages: &[Stage],
    start: Mesh,
    views: &[View],
    progress: &mut Progress,
) -> anyhow::Result<Mesh> {
    let (backend, views): (_, Arc<[View]>) = (given.backend()?, views.into());
    let asked = given.method()?;
    let edge = EdgeSoftness { family: Family::Logistic, squared: false };
    let narrow = Method {
        name: "logistic".to_owned(),
        softness: ScheduledSoftness::constant(edge, NARROW),
        ..asked.clone()
    };
    let (mut mesh, mut done) = (start, 0);
    for (k, stage) in stages.iter().enumerate() {
        if stage.finer {
            mesh = mesh.subdivided();
        }
        let method = if stage.narrow && !given.names_softness() { &narrow } else { &asked };
        let problem = FromViews::new(mesh.clone(), views.clone(), flags.smooth.unwrap_or(1.0))?;
        let last = k + 1 == stages.len();
        let config = SolveConfig {
            size: given.common.size.filter(|_| last).unwrap_or(stage.size),
            steps: stage.steps,
            learning_rate: given.learning_rate().unwrap_or(stage.learning_rate),
        };
        let mut best = f64::INFINITY;
        on_backend!(backend, B => minimize::<_, B>(&problem, &[()], method, &config, |iterate, _| {
            if iterate.hard_loss[0] < best {
                best = iterate.hard_loss[0];
                mesh = problem.mesh(&iterate.theta)?;
            }
            progress.step(done + iterate.step, iterate.loss[0])
        }))?;
        done += config.steps;
        if 1.0 - best >= RESTART_ABOVE {
            break;
        }
    }
    Ok(mesh)
}
