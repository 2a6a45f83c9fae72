//! Poses from the user's pictures.

mod answer;
mod camera_forms;

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use softrast_cli::{Answer, Given, MaskFlags, Variant};
use softrast_inverse::pose::{PoseSearch, Symmetry, symmetries};
use softrast_lab::Error;
use softrast_raster::{NEAR, Pinhole, on_backend};
use softrast_views::{
    CameraFile, Lens, PaintedView, PoseFile, View, cut_sides, faces_across_note, reading_notes,
};

use self::answer::{Framed, POSES, Solved, answer, overlay_names};
use crate::{
    Args, Instances,
    colour::coloured,
    framing::{Viewed, viewed},
};

/// Default field of view along the shorter side without a camera, in degrees.
const ASSUMED_FOV_DEG: f64 = 45.0;

/// A picture and its camera.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Pictures {
    /// Picture of the object. Its mask is the one of --masks or --camera, else its transparency, or
    /// its luminance if it is opaque. With --colour its colours are compared too
    #[arg(long, value_name = "PICTURE")]
    pub target: Option<PathBuf>,

    /// Folder of pictures; writes a table of all
    #[arg(long, value_name = "DIR", conflicts_with = "target")]
    pub targets: Option<PathBuf>,

    /// Camera: JSON with fx, fy, cx, cy, width and height, or K. Or cameras of many pictures,
    /// matched by name: transforms.json, or a folder with that or a COLMAP model [default: a field
    /// of view of 45 degrees]
    #[arg(long, value_name = "FILE")]
    pub camera: Option<PathBuf>,

    /// Start pose instead of a search over all poses, for the mesh as it is in its file: JSON with
    /// R and t, `transform_matrix`, or a result of this program
    #[arg(long, value_name = "FILE.json", requires = "target")]
    pub start: Option<PathBuf>,

    /// Conversion of pictures to masks.
    #[command(flatten)]
    pub masks: MaskFlags,
}

impl Pictures {
    /// Whether a flag names pictures.
    pub(crate) fn is_given(&self) -> bool {
        let Self { target, targets, camera, start, masks } = self;
        [target, targets, camera, start].into_iter().any(Option::is_some) || masks.is_given()
    }

    fn paths(&self) -> anyhow::Result<Vec<PathBuf>> {
        if let Some(target) = &self.target {
            return Ok(vec![target.clone()]);
        }
        let Some(folder) = &self.targets else {
            return Err(Error::usage(
                "--camera, --start, --masks, --invert, --threshold and --label are about a picture: name it with --target, or a folder with --targets",
            ));
        };
        let read = || format!("cannot read the folder {}", folder.display());
        let mut paths = Vec::new();
        for entry in std::fs::read_dir(folder).with_context(read)? {
            let path = entry.with_context(read)?.path();
            let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
            let is_picture = ending.is_some_and(|ending| {
                ["png", "jpg", "jpeg", "gif"].iter().any(|known| ending == *known)
            });
            if is_picture {
                paths.push(path);
            }
        }
        paths.sort();
        ensure!(
            !paths.is_empty(),
            "there is no picture in {}: PNG, JPEG and GIF are looked for",
            folder.display()
        );
        Ok(paths)
    }
}

pub(crate) fn solve_pictures(
    given: &Given<'_, Args>,
    pictures: &Pictures,
) -> anyhow::Result<Answer> {
    let args = given.args;
    refuse_flags_of_seeds(given)?;
    let Viewed { mesh, frame, notes: of_mesh, .. } = viewed(args)?;
    if args.colour {
        coloured(args, &mesh)?;
    }
    let (method, backend) = (given.method()?, given.backend()?);
    let cameras = pictures.camera.as_ref().map(CameraFile::load).transpose()?;
    let start = pictures.start.as_ref().map(PoseFile::load).transpose()?;
    let started = start.is_some();
    let search = |camera: &Pinhole| {
        let mut search = PoseSearch::new(&mesh, *camera).with_method(method.clone());
        search = if started { search.starting_at(camera) } else { search };
        search = if args.optimise_fov { search.optimising_fov() } else { search };
        search = match given.common.steps {
            Some(steps) => search.with_fine_steps(steps),
            None => search,
        };
        search = match given.common.size {
            Some(size) => search.with_fine_size(size),
            None => search,
        };
        search.with_learning_rate(given.learning_rate().unwrap_or(PoseSearch::LEARNING_RATE))
    };
    let paths = pictures.paths()?;
    // Checks at once what would fail midway.
    let mut tasks = Vec::new();
    let mut reads = cameras.as_ref().map_or(Vec::new(), |cameras| cameras.files().to_vec());
    for path in paths {
        let named = || cameras.as_ref().and_then(|cameras| cameras.mask_of(&path));
        let mask_path = pictures.masks.of(&path)?.or_else(named).unwrap_or_else(|| path.clone());
        let mask = pictures.masks.load(&mask_path)?;
        let size = mask.whole_size();
        let taken = match &cameras {
            Some(cameras) => cameras.lens_of(&path),
            None => Ok(Lens::of_fov(ASSUMED_FOV_DEG, size)),
        };
        let (mut camera, distortion) =
            taken.and_then(|lens| lens.camera(size)).with_context(|| {
                let camera = pictures.camera.as_deref().unwrap_or(Path::new("the camera"));
                format!("{} with {}", camera.display(), path.display())
            })?;
        if let Some(start) = &start {
            (camera.rotation, camera.translation) = (start.rotation, start.translation);
            camera = frame.camera(&camera);
        }
        let camera = mask.camera(&camera);
        let mask = match &distortion {
            Some(distortion) => mask.undistorted(&camera, distortion),
            None => mask,
        };
        search(&camera).check(&mask).with_context(|| path.display().to_string())?;
        reads.push(mask_path);
        let name = path.display().to_string();
        let view = View { name, picture: path, mask, camera, distortion, off: 0.0 };
        let painted = args.colour.then(|| PaintedView::load(&view)).transpose()?;
        tasks.push((view, painted));
    }
    let views: Vec<View> = tasks.iter().map(|(view, _)| view.clone()).collect();
    let notes = start.iter().filter_map(|start| start.note.clone()).chain(reading_notes(&views));
    let notes: Vec<String> = notes.collect();
    let single = pictures.target.is_some();
    let paths: Vec<PathBuf> = tasks.iter().map(|(view, _)| view.picture.clone()).collect();
    let overlays = overlay_names(&paths, single);
    let poses = (!single).then_some(POSES);
    reads.extend(paths);
    given.will_write(overlays.iter().map(String::as_str).chain(poses), reads)?;
    let steps = |(view, painted): &(View, Option<PaintedView>)| match painted {
        Some(painted) => search(&view.camera).steps_by_colour(painted),
        None => search(&view.camera).steps(&view.mask),
    };
    let mut progress = given.progress(tasks.iter().map(steps).sum())?;
    let (mut solved, mut begun) = (Vec::new(), 0);
    for task in tasks {
        let clock = std::time::Instant::now();
        let before = begun;
        begun += steps(&task);
        let (view, painted) = task;
        let visit = |step: usize, loss: f64| progress.step(before + step, loss);
        let View { name, picture: path, mask, camera, distortion, .. } = view;
        let search = search(&camera).progress(visit);
        let poses = on_backend!(backend, B => match &painted {
            Some(view) => search.run_by_colour::<B>(view),
            None => search.run::<B>(&mask),
        });
        let poses = poses.context(name)?;
        let seconds = clock.elapsed().as_secs_f64();
        solved.push(Solved { path, mask, distortion, painted, poses, seconds });
    }
    progress.finish();
    let best = solved.iter().map(|one| (one.path.display(), one.poses[0].camera));
    let across = faces_across_note(&mesh, best, NEAR);
    let mut warnings = warnings(cameras.is_some(), args.optimise_fov, &solved);
    // A given start or colours determine the rotation.
    let symmetries = if started || args.colour { Vec::new() } else { symmetries(&mesh) };
    warnings
        .extend(of_mesh.into_iter().chain(notes).chain(across).chain(symmetry_note(&symmetries)));
    let name = args.mesh.as_ref().map_or("fox".to_owned(), |path| path.display().to_string());
    let mesh = Framed { mesh, name, frame, started, symmetries };
    answer(&mesh, &solved, &overlays, warnings, single)
}

/// Refuses flags that apply to seeds only.
fn refuse_flags_of_seeds(given: &Given<'_, Args>) -> anyhow::Result<()> {
    let (args, common) = (given.args, given.common);
    let flags = [
        ("--range", args.range.is_some()),
        ("--instances", args.instances != Instances::Seeded),
        ("--starts", args.starts.is_some()),
        ("--variant", common.variant != Variant::Original),
        ("--seed", common.seed != 0),
    ];
    match flags.iter().find(|(_, given)| *given) {
        Some((flag, _)) => Err(Error::usage(format!(
            "{flag} says which target is drawn: leave it out with --target and --targets"
        ))),
        None => Ok(()),
    }
}

/// A warning about the symmetries of a mesh, which masks cannot resolve.
fn symmetry_note(symmetries: &[Symmetry]) -> Option<String> {
    let turns = symmetries.iter().map(|Symmetry { axis: [x, y, z], degrees }| {
        let turn = degrees.map_or_else(|| "any angle".to_owned(), |by| format!("{by} degrees"));
        format!("{turn} about ({x:.2}, {y:.2}, {z:.2})")
    });
    let turns = turns.collect::<Vec<_>>().join(", ");
    (!symmetries.is_empty()).then(|| {
        format!(
            "the mesh has the same silhouettes turned by {turns}: masks do not tell these poses apart, and one of them is given (--colour, with a \
             coloured mesh)"
        )
    })
}

fn warnings(calibrated: bool, optimised: bool, solved: &[Solved]) -> Vec<String> {
    let mut warnings = Vec::new();
    if !calibrated {
        warnings.push(format!(
            "no camera was given: a field of view of {ASSUMED_FOV_DEG} degrees along the shorter side {}; --camera FILE.json gives one{}",
            if optimised { "was the start" } else { "is assumed" },
            if optimised { "" } else { ", --optimise-fov looks for it" },
        ));
    }
    for Solved { path, mask, poses, .. } in solved {
        let cut = cut_sides(mask);
        if !cut.is_empty() {
            warnings.push(format!(
                "{}: the mask reaches the {} of the picture, so the object may go on there: only what is in the picture is compared, and \
                 other poses may fit as well",
                path.display(),
                cut.join(" and the ")
            ));
        }
        let iou = poses[0].iou;
        if iou < 0.8 {
            warnings.push(format!(
                "{}: the best pose has an IoU of {iou:.3} only: check that the mesh, the camera and the mask belong together (--invert?)",
                path.display()
            ));
        }
    }
    warnings
}
