//! Poses from pictures that the user gives.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use image::RgbImage;
use serde_json::json;
use softrast_cli::{Answer, Given, seen_by};
use softrast_inverse::{
    Lens, Picture, camera_json, load_pose,
    pose::{FoundPose, PoseSearch},
    silhouette_pixels,
};
use softrast_lab::{
    Error, Viewer, contact_sheet,
    format::{counted, line},
    overlay,
    parse::share,
    png,
    program::Output,
    report::{Report, Table},
};
use softrast_mesh::Mesh;
use softrast_raster::{Pinhole, on_backend};

use crate::{Pose, task::mesh};

/// Field of view along the shorter side where no camera is given, in degrees.
const ASSUMED_FOV_DEG: f64 = 45.0;

/// A picture and the camera that took it.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Your own pictures")]
pub struct Pictures {
    /// Mask whose pose is asked: its transparency, or its luminance where all of it is opaque
    #[arg(long, value_name = "PICTURE")]
    pub target: Option<PathBuf>,

    /// Folder of such masks, taken with one camera; a table of all is written
    #[arg(long, value_name = "DIR", conflicts_with = "target")]
    pub targets: Option<PathBuf>,

    /// Camera: JSON with fx, fy, cx, cy, width and height, or K, or a transforms.json [default: 45 degrees are assumed]
    #[arg(long, value_name = "FILE.json")]
    pub camera: Option<PathBuf>,

    /// Where to start instead of everywhere: JSON with R and t, `transform_matrix`, or a result of this program
    #[arg(long, value_name = "FILE.json", requires = "target")]
    pub start: Option<PathBuf>,

    /// Take what is black for the mask
    #[arg(long)]
    pub invert: bool,

    /// Take for the mask what is at least so bright, 0 to 1, instead of keeping soft edges
    #[arg(long, value_name = "X", value_parser = share, allow_negative_numbers = true)]
    pub threshold: Option<f64>,
}

impl Pictures {
    /// Whether there is one.
    pub(crate) fn asked(&self) -> bool {
        let Self { target, targets, camera, start, invert, threshold } = self;
        target.is_some()
            || targets.is_some()
            || camera.is_some()
            || start.is_some()
            || *invert
            || threshold.is_some()
    }

    fn paths(&self) -> anyhow::Result<Vec<PathBuf>> {
        if let Some(target) = &self.target {
            return Ok(vec![target.clone()]);
        }
        let Some(folder) = &self.targets else {
            return Err(Error::usage(
                "--camera, --start, --invert and --threshold are about a picture: name it with --target, or a folder with --targets",
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

    fn load(&self, path: &Path) -> anyhow::Result<Picture> {
        let mask = Picture::load_mask(path)?;
        let mask = if self.invert { mask.inverted() } else { mask };
        Ok(match self.threshold {
            Some(level) => mask.thresholded(level),
            None => mask,
        })
    }
}

/// A mask and what was found for it, the best first.
struct Solved {
    path: PathBuf,
    mask: Picture,
    poses: Vec<FoundPose>,
    seconds: f64,
}

pub(crate) fn solve_pictures(
    given: &Given<'_, Pose>,
    pictures: &Pictures,
) -> anyhow::Result<Answer> {
    let args = given.args;
    let (mesh, mesh_name) = mesh(args)?;
    let framing = Framing::new(args, &mesh)?;
    let (method, backend) = (given.method()?, given.backend()?);
    let mut search = PoseSearch { optimise_fov: args.optimise_fov, ..PoseSearch::default() };
    search.learning_rate = given.learning_rate().unwrap_or(search.learning_rate);
    search.fine_size = given.common.size.unwrap_or(search.fine_size);
    search.fine_steps = given.common.steps.unwrap_or(search.fine_steps);
    let lens = pictures.camera.as_ref().map(Lens::load).transpose()?;
    let start = pictures.start.as_ref().map(load_pose).transpose()?;
    let paths = pictures.paths()?;
    // What would fail in the middle fails at once.
    let mut tasks = Vec::new();
    for path in paths {
        let mask = pictures.load(&path)?;
        let size = mask.size();
        let lens = lens.clone().unwrap_or_else(|| Lens::of_fov(ASSUMED_FOV_DEG, size));
        let mut camera = lens.pinhole(size).with_context(|| {
            let camera = pictures.camera.as_deref().unwrap_or(Path::new("the camera"));
            format!("{} with {}", camera.display(), path.display())
        })?;
        if let Some((rotation, translation)) = start {
            (camera.rotation, camera.translation) = (rotation, translation);
        }
        tasks.push((path, mask, camera));
    }
    let steps = search.steps(start.is_some());
    let mut progress = given.progress(steps * tasks.len())?;
    let mut solved = Vec::new();
    for (k, (path, mask, camera)) in tasks.into_iter().enumerate() {
        let clock = std::time::Instant::now();
        let visit = |step: usize, loss: f64| progress.step(k * steps + step, loss);
        let poses = on_backend!(backend, B => search.run::<B>(&mesh, &mask, &camera, start.is_some(), &method, visit));
        let poses = poses.with_context(|| path.display().to_string())?;
        solved.push(Solved { path, mask, poses, seconds: clock.elapsed().as_secs_f64() });
    }
    progress.finish();
    answer(pictures, &mesh, &mesh_name, &framing, lens.is_some(), args.optimise_fov, &solved)
}

/// How the mesh was moved from where it is in its file.
struct Framing {
    middle: [f64; 3],
    scale: f64,
}

impl Framing {
    fn new(args: &crate::Args, mesh: &Mesh) -> anyhow::Result<Self> {
        let original = match &args.mesh {
            Some(path) if !args.raw => Mesh::load(path)?,
            _ => mesh.clone(),
        };
        let longest = |mesh: &Mesh| {
            let [low, high] = mesh.bounds();
            (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max)
        };
        let [low, high] = original.bounds();
        let moved = args.mesh.is_some() && !args.raw;
        let middle = if moved { [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0) } else { [0.0; 3] };
        let scale = longest(mesh) / longest(&original);
        Ok(Self { middle, scale: if scale.is_finite() { scale } else { 1.0 } })
    }

    /// The camera for the mesh as it is in its file.
    fn of_file(&self, camera: &Pinhole) -> Pinhole {
        let turned =
            camera.rotation.map(|row| (0..3).map(|k| row[k] * self.middle[k]).sum::<f64>());
        let translation = [0, 1, 2].map(|k| camera.translation[k] / self.scale - turned[k]);
        Pinhole { translation, ..*camera }
    }
}

fn answer(
    pictures: &Pictures,
    mesh: &Mesh,
    mesh_name: &str,
    framing: &Framing,
    calibrated: bool,
    optimised: bool,
    solved: &[Solved],
) -> anyhow::Result<Answer> {
    let mut page = Report::new("pose", "The camera from which a mesh has the silhouette of a mask");
    let mut output = Output::default();
    if !calibrated {
        output.warnings.push(format!(
            "no camera was given: a field of view of {ASSUMED_FOV_DEG} degrees along the shorter side {}; --camera FILE.json gives one{}",
            if optimised { "was the start" } else { "is assumed" },
            if optimised { "" } else { ", --optimise-fov looks for it" },
        ));
    }
    for Solved { path, poses, .. } in solved {
        let iou = poses[0].iou;
        if iou < 0.8 {
            output.warnings.push(format!(
                "{}: the best pose has an IoU of {iou:.3} only: check that the mesh, the camera and the mask belong together (--invert?)",
                path.display()
            ));
        }
    }
    page.warnings(&output.warnings);
    let single = pictures.target.is_some();
    let name = |k: usize, what: &str| match single {
        true => format!("{what}.png"),
        false => format!(
            "{what}-{}.png",
            solved[k].path.file_stem().unwrap_or_default().to_string_lossy()
        ),
    };
    let best: Vec<RgbImage> = solved.iter().map(|one| drawn(mesh, one, &one.poses[0])).collect();
    let picture = png(&contact_sheet(&best, 4.min(best.len())))?;
    page.viewer(
        &viewer(mesh, solved)?,
        &picture,
        "The mesh and the cameras that were found. A view shows it with the outline of its mask.",
    );
    let mut table = Table::new(["picture", "IoU", "other poses", "their IoU", "seconds"]);
    let mut files = Vec::new();
    let mut results = Vec::new();
    for (k, one) in solved.iter().enumerate() {
        let Solved { path, poses, seconds, .. } = one;
        let best = png(&best[k])?;
        page.heading(&path.display().to_string());
        page.picture(
            &best,
            "The mask in grey with the silhouette of the answer over it: orange where only the mask is, blue where only the silhouette is.",
        );
        page.table(&of_camera(&poses[0]));
        if poses.len() > 1 {
            let others: Vec<RgbImage> =
                poses[1..].iter().map(|pose| drawn(mesh, one, pose)).collect();
            page.picture(
                &png(&contact_sheet(&others, 3.min(others.len())))?,
                "Other poses that fit nearly as well: a silhouette does not tell them apart.",
            );
        }
        files.push((name(k, "overlay"), best));
        let others: Vec<String> =
            poses[1..].iter().map(|pose| format!("{:.4}", pose.iou)).collect();
        let picture = path.display().to_string();
        table.push([
            picture.clone(),
            format!("{:.4}", poses[0].iou),
            (poses.len() - 1).to_string(),
            others.join(", "),
            format!("{seconds:.1}"),
        ]);
        results.push(json!({
            "target": picture,
            "camera": camera_json(&poses[0].camera),
            "camera_in_file": camera_json(&framing.of_file(&poses[0].camera)),
            "iou": poses[0].iou,
            "alternatives": poses[1..].iter().map(|pose| json!({
                "camera": camera_json(&pose.camera),
                "camera_in_file": camera_json(&framing.of_file(&pose.camera)),
                "iou": pose.iou,
            })).collect::<Vec<_>>(),
            "seconds": seconds,
        }));
    }
    output.text = text(mesh_name, solved, single);
    let mean = solved.iter().map(|of| of.poses[0].iou).sum::<f64>() / solved.len() as f64;
    if single {
        output.json = results.swap_remove(0);
    } else {
        page.heading("All pictures");
        page.table(&table);
        files.push(("poses.csv".to_owned(), csv(solved).into_bytes()));
        output.json = json!({ "mean_iou": mean, "pictures": results });
    }
    output.json["mesh"] =
        json!({ "name": mesh_name, "middle": framing.middle, "scale": framing.scale });
    output.json["warnings"] = json!(output.warnings);
    page.note(
        "R and t are as OpenCV has them: a point p is seen at R p + t, with x right, y down and z ahead. They belong to the mesh as it \
         was taken: centred and with its longest side 2, or with --raw as it stands. result.json also has them for the mesh as it is in \
         its file (camera_in_file).",
    );
    let beside = if single {
        "result.json holds the camera and the alternatives, overlay.png the picture"
    } else {
        "result.json holds all cameras and alternatives, poses.csv a line for each picture"
    };
    Ok(Answer { page, output, files, beside: beside.to_owned() })
}

/// The mask with the silhouette at the pose over it.
fn drawn(mesh: &Mesh, one: &Solved, pose: &FoundPose) -> RgbImage {
    let silhouette = silhouette_pixels(mesh, &pose.camera);
    overlay(&silhouette, one.mask.pixels(), pose.camera.size.width)
}

/// The mesh with all poses that were found.
fn viewer(mesh: &Mesh, solved: &[Solved]) -> anyhow::Result<Viewer> {
    let views = solved.iter().flat_map(|Solved { path, mask, poses, .. }| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        poses.iter().enumerate().map(move |(rank, FoundPose { camera, iou })| {
            let name =
                if rank == 0 { name.to_string() } else { format!("{name}, alternative {rank}") };
            seen_by(name, camera, mask, format!("IoU {iou:.4}"))
        })
    });
    Ok(Viewer {
        positions: mesh.positions().to_vec(),
        faces: mesh.faces().to_vec(),
        views: views.collect::<anyhow::Result<_>>()?,
    })
}

fn text(mesh_name: &str, solved: &[Solved], single: bool) -> Vec<String> {
    let mut text = vec![format!("pose of {mesh_name} from {}", counted(solved.len(), "picture"))];
    for Solved { path, poses, seconds, .. } in solved {
        let FoundPose { camera, iou } = &poses[0];
        if !single {
            text.push(line(
                &path.display().to_string(),
                &format!(
                    "IoU {iou:.4}, {}, {seconds:.1} s",
                    counted(poses.len() - 1, "alternative")
                ),
            ));
            continue;
        }
        text.push(line("IoU", &format!("{iou:.4}")));
        for (k, row) in camera.rotation.iter().enumerate() {
            let numbers = row.map(|x| format!("{x:9.6}")).join(" ");
            text.push(line(if k == 0 { "R" } else { "" }, &numbers));
        }
        text.push(line("t", &camera.translation.map(|x| format!("{x:9.6}")).join(" ")));
        text.push(line(
            "fx, fy, cx, cy",
            &[camera.focal, camera.centre]
                .concat()
                .iter()
                .map(|x| format!("{x:.3}"))
                .collect::<Vec<_>>()
                .join(" "),
        ));
        for (k, pose) in poses[1..].iter().enumerate() {
            text.push(line(&format!("alternative {}", k + 1), &format!("IoU {:.4}", pose.iou)));
        }
        text.push(line("seconds", &format!("{seconds:.1}")));
    }
    text
}

fn csv(solved: &[Solved]) -> String {
    let head =
        "picture,rank,iou,r11,r12,r13,r21,r22,r23,r31,r32,r33,t1,t2,t3,fx,fy,cx,cy\n".to_owned();
    solved.iter().fold(head, |text, Solved { path, poses, .. }| {
        let name = path.display().to_string().replace('"', "\"\"");
        poses.iter().enumerate().fold(text, |text, (rank, FoundPose { camera, iou })| {
            let Pinhole { rotation, translation, focal, centre, .. } = camera;
            let numbers = [&[*iou], rotation.as_flattened(), translation, focal, centre].concat();
            let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
            format!("{text}\"{name}\",{rank},{}\n", numbers.join(","))
        })
    })
}

fn of_camera(pose: &FoundPose) -> Table {
    let camera = &pose.camera;
    let row =
        |values: &[f64]| values.iter().map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(", ");
    let mut pairs = vec![["IoU".to_owned(), format!("{:.4}", pose.iou)]];
    for (k, values) in camera.rotation.iter().enumerate() {
        pairs.push([format!("R, row {}", k + 1), row(values)]);
    }
    pairs.push(["t".to_owned(), row(&camera.translation)]);
    pairs.push(["fx, fy, cx, cy".to_owned(), row(&[camera.focal, camera.centre].concat())]);
    if let Some(orbit) = camera.orbit() {
        pairs.push(["orbit".to_owned(), format!("{orbit:?}")]);
    }
    Table::pairs(pairs)
}
