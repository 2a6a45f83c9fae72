//! Poses from pictures that the user gives.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use anyhow::{Context, ensure};
use image::RgbImage;
use serde_json::{Value, json};
use softrast_cli::{Answer, Given, MaskFlags, Variant, seen_by};
use softrast_inverse::{
    Frame, Lens, PaintedView, Picture, PoseFile, View, camera_json, coloured_pixels, cut_sides,
    faces_across_note,
    pose::{FoundPose, PoseSearch},
    reading_notes, silhouette_pixels,
};
use softrast_lab::{
    Error, Viewer, contact_sheet, for_page,
    format::{counted, line},
    overlay, png,
    program::Output,
    report::{Report, Table},
    rgb_from_planes, shown,
};
use softrast_mesh::Mesh;
use softrast_raster::{NEAR, Pinhole, on_backend};

use crate::{Args, Instances, colour::coloured, framing::mesh};

/// Field of view along the shorter side where no camera is given, in degrees.
const ASSUMED_FOV_DEG: f64 = 45.0;
/// Answers that a picture of many shows.
const SHOWN: usize = 12;

/// A picture and the camera that took it.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Pictures {
    /// Mask of the object: the transparency of a picture, or its luminance if all of it is opaque. With --colour the colours count too
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

    /// How pictures become masks.
    #[command(flatten)]
    pub masks: MaskFlags,
}

impl Pictures {
    /// Whether there is one.
    pub(crate) fn asked(&self) -> bool {
        let Self { target, targets, camera, start, masks } = self;
        [target, targets, camera, start].into_iter().any(Option::is_some) || masks.asked()
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
}

/// A mask and what was found for it, the best first.
struct Solved {
    path: PathBuf,
    mask: Picture,
    /// Its colours, where they count.
    painted: Option<PaintedView>,
    poses: Vec<FoundPose>,
    seconds: f64,
}

impl Solved {
    /// A pose with the camera of the picture in its file, which may have more pixels than the mask.
    fn of_file(&self, pose: &FoundPose) -> FoundPose {
        FoundPose { camera: self.mask.whole_camera(&pose.camera), ..*pose }
    }
}

pub(crate) fn solve_pictures(
    given: &Given<'_, Args>,
    pictures: &Pictures,
) -> anyhow::Result<Answer> {
    let args = given.args;
    refuse_flags_of_seeds(given)?;
    let (mesh, mesh_name, frame) = mesh(args)?;
    if args.colour {
        coloured(args, &mesh)?;
    }
    let (method, backend) = (given.method()?, given.backend()?);
    let mut search = PoseSearch { optimise_fov: args.optimise_fov, ..PoseSearch::default() };
    search.learning_rate = given.learning_rate().unwrap_or(search.learning_rate);
    search.fine_size = given.common.size.unwrap_or(search.fine_size);
    search.fine_steps = given.common.steps.unwrap_or(search.fine_steps);
    let lens = pictures.camera.as_ref().map(Lens::load).transpose()?;
    let start = pictures.start.as_ref().map(PoseFile::load).transpose()?;
    let paths = pictures.paths()?;
    // What would fail in the middle fails at once.
    let mut tasks = Vec::new();
    for path in paths {
        let mask = pictures.masks.load(&path)?;
        let size = mask.whole_size();
        let lens = lens.clone().unwrap_or_else(|| Lens::of_fov(ASSUMED_FOV_DEG, size));
        let mut camera = lens.pinhole(size).with_context(|| {
            let camera = pictures.camera.as_deref().unwrap_or(Path::new("the camera"));
            format!("{} with {}", camera.display(), path.display())
        })?;
        if let Some(start) = &start {
            (camera.rotation, camera.translation) = (start.rotation, start.translation);
        }
        let camera = mask.camera(&camera);
        PoseSearch::check(&mesh, &mask, &camera, start.is_some())
            .with_context(|| path.display().to_string())?;
        let view = View { name: path.display().to_string(), picture: path, mask, camera, off: 0.0 };
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
    given.will_write(overlays.iter().map(String::as_str).chain(poses), paths)?;
    let steps = |(view, _): &(View, _)| search.steps(&view.mask, start.is_some());
    let mut progress = given.progress(tasks.iter().map(steps).sum())?;
    let (mut solved, mut begun) = (Vec::new(), 0);
    for task in tasks {
        let clock = std::time::Instant::now();
        let (before, (view, painted)) = (begun, task);
        begun += search.steps(&view.mask, start.is_some());
        let visit = |step: usize, loss: f64| progress.step(before + step, loss);
        let (View { name, picture: path, mask, camera, .. }, started) = (view, start.is_some());
        let poses = on_backend!(backend, B => match &painted {
            Some(view) => search.run_by_colour::<B>(&mesh, view, started, &method, visit),
            None => search.run::<B>(&mesh, &mask, &camera, started, &method, visit),
        });
        let poses = poses.context(name)?;
        solved.push(Solved { path, mask, painted, poses, seconds: clock.elapsed().as_secs_f64() });
    }
    progress.finish();
    let best = solved.iter().map(|one| (one.path.display(), one.poses[0].camera));
    let across = faces_across_note(&mesh, best, NEAR);
    let mut warnings = warnings(lens.is_some(), args.optimise_fov, &solved);
    warnings.extend(notes.into_iter().chain(across));
    let mesh = Framed { mesh, name: mesh_name, frame };
    answer(&mesh, &solved, &overlays, warnings, single)
}

/// The mesh that is looked for.
struct Framed {
    mesh: Mesh,
    name: String,
    /// In which it is looked for, of its file.
    frame: Frame,
}

/// Flags that say what is drawn as a target.
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

fn answer(
    mesh: &Framed,
    solved: &[Solved],
    names: &[String],
    warnings: Vec<String>,
    single: bool,
) -> anyhow::Result<Answer> {
    let overlays: Vec<RgbImage> =
        solved.iter().map(|one| drawn(&mesh.mesh, one, &one.poses[0])).collect();
    let page = page(&mesh.mesh, solved, &overlays, &warnings, single)?;
    let mut files = Vec::new();
    for (name, overlay) in names.iter().zip(&overlays) {
        files.push((name.clone(), png(overlay)?));
    }
    if !single {
        files.push((POSES.to_owned(), csv(solved).into_bytes()));
    }
    let json = json(mesh, solved, &warnings, single);
    let output = Output { text: text(&mesh.name, solved, single), json, warnings, partial: None };
    let beside = if single {
        "result.json holds the camera and the alternatives, overlay.png the picture"
    } else {
        "result.json holds all cameras and alternatives, poses.csv a line for each picture"
    };
    Ok(Answer { page, output, files, beside: beside.to_owned() })
}

/// A line for each pose of many pictures.
const POSES: &str = "poses.csv";

/// The files with mask and silhouette of the answers, one for each picture: `overlay-NAME.png`, and `overlay-NAME.png-2.png` where a
/// picture before has that, also where upper and lower case are one.
fn overlay_names(pictures: &[PathBuf], single: bool) -> Vec<String> {
    if single {
        return vec!["overlay.png".to_owned()];
    }
    let mut taken = HashSet::new();
    let mut free = |name: &String| taken.insert(name.to_lowercase());
    let named = |path: &PathBuf| {
        let whole = path.file_name().unwrap_or_default().to_string_lossy();
        let name = format!("overlay-{}.png", whole.strip_suffix(".png").unwrap_or(&whole));
        let more = (2..).map(|k| format!("overlay-{whole}-{k}.png"));
        [name].into_iter().chain(more).find(&mut free).unwrap_or_default()
    };
    pictures.iter().map(named).collect()
}

fn page(
    mesh: &Mesh,
    solved: &[Solved],
    overlays: &[RgbImage],
    warnings: &[String],
    single: bool,
) -> anyhow::Result<Report> {
    let mut page = Report::new("pose", "The camera from which a mesh has the silhouette of a mask");
    page.warnings(warnings);
    let small: Vec<RgbImage> = overlays.iter().map(|overlay| for_page(overlay.clone())).collect();
    let first = &small[..SHOWN.min(small.len())];
    page.viewer(
        &viewer(mesh, solved)?,
        &png(&contact_sheet(first, 4.min(first.len())))?,
        "The mesh and the cameras that were found. A view shows it with the outline of its mask.",
    );
    let mut table = Table::new(["picture", "IoU", "other poses", "their IoU", "seconds"]);
    for (one, overlay) in solved.iter().zip(&small) {
        let Solved { path, poses, seconds, .. } = one;
        page.heading(&path.display().to_string());
        page.picture(
            &png(overlay)?,
            "The mask in grey with the silhouette of the answer over it: orange where only the mask is, blue where only the silhouette is.",
        );
        if let Some(pair) = beside(mesh, one)? {
            page.picture(
                &png(&pair)?,
                "The colours of the picture that count, over black, and the mesh in its own colours at the answer.",
            );
        }
        page.table(&of_camera(&one.of_file(&poses[0])));
        if poses.len() > 1 {
            let others = poses[1..].iter().map(|pose| for_page(drawn(mesh, one, pose)));
            let others: Vec<RgbImage> = others.collect();
            page.picture(
                &png(&contact_sheet(&others, 3.min(others.len())))?,
                match one.painted {
                    Some(_) => "Other poses that fit nearly as well.",
                    None => {
                        "Other poses that fit nearly as well: a silhouette does not tell them apart."
                    }
                },
            );
        }
        let others: Vec<String> =
            poses[1..].iter().map(|pose| format!("{:.4}", pose.iou)).collect();
        table.push([
            path.display().to_string(),
            format!("{:.4}", poses[0].iou),
            (poses.len() - 1).to_string(),
            others.join(", "),
            format!("{seconds:.1}"),
        ]);
    }
    if !single {
        page.heading("All pictures");
        page.table(&table);
    }
    page.note(
        "R and t are as OpenCV has them: a point p is seen at R p + t, with x right, y down and z ahead. They belong to the mesh as it \
         was taken: centred and with its longest side 2, or with --raw as it stands. result.json also has them for the mesh as it is in \
         its file (camera_in_file).",
    );
    Ok(page)
}

fn json(mesh: &Framed, solved: &[Solved], warnings: &[String], single: bool) -> Value {
    let Framed { name, frame, .. } = mesh;
    let posed = |pose: &FoundPose| {
        json!({
            "camera": camera_json(&pose.camera),
            "camera_in_file": camera_json(&frame.camera_to_world(&pose.camera)),
            "iou": pose.iou,
            "psnr": pose.psnr,
        })
    };
    let mut results: Vec<Value> = Vec::new();
    for one in solved {
        let Solved { path, mask, poses, seconds, .. } = one;
        let mut result = posed(&one.of_file(&poses[0]));
        result["target"] = shown(path).into();
        result["alternatives"] = poses[1..].iter().map(|pose| posed(&one.of_file(pose))).collect();
        result["cut_sides"] = json!(cut_sides(mask));
        result["seconds"] = json!(seconds);
        results.push(result);
    }
    let mut json = if single {
        results.swap_remove(0)
    } else {
        let mean = solved.iter().map(|of| of.poses[0].iou).sum::<f64>() / solved.len() as f64;
        json!({ "mean_iou": mean, "pictures": results })
    };
    json["mesh"] = json!({ "name": name, "middle": frame.middle, "scale": 1.0 / frame.unit });
    json["warnings"] = json!(warnings);
    json
}

/// The mask with the silhouette at the pose over it.
fn drawn(mesh: &Mesh, one: &Solved, pose: &FoundPose) -> RgbImage {
    let silhouette = silhouette_pixels(mesh, &pose.camera);
    overlay(&silhouette, one.mask.pixels(), pose.camera.size.width)
}

/// The colours of a picture, and those of the mesh at the answer.
fn beside(mesh: &Mesh, one: &Solved) -> anyhow::Result<Option<RgbImage>> {
    let Some(view) = &one.painted else { return Ok(None) };
    let camera = &one.poses[0].camera;
    let picture = view.over_black.iter().flat_map(|channel| channel.pixels());
    let [red, green, blue, _] = coloured_pixels(mesh, camera);
    let planes = [picture.map(|&x| f64::from(x)).collect(), [red, green, blue].concat()];
    let images = planes.map(|planes: Vec<f64>| {
        for_page(rgb_from_planes(&planes, camera.size.width, camera.size.height))
    });
    Ok(Some(contact_sheet(&images, 2)))
}

/// The mesh with all poses that were found.
fn viewer(mesh: &Mesh, solved: &[Solved]) -> anyhow::Result<Viewer> {
    // A page keeps coordinates in 32 bits.
    let frame = Frame::of_mesh(mesh);
    let views = solved.iter().flat_map(|Solved { path, mask, poses, .. }| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        poses.iter().enumerate().map(move |(rank, FoundPose { camera, iou, .. })| {
            let name =
                if rank == 0 { name.to_string() } else { format!("{name}, alternative {rank}") };
            seen_by(name, &frame.camera(camera), mask, format!("IoU {iou:.4}"))
        })
    });
    Ok(Viewer {
        positions: mesh.positions().iter().map(|&p| frame.point(p)).collect(),
        faces: mesh.faces().to_vec(),
        colours: mesh.colours().map(<[_]>::to_vec),
        views: views.collect::<anyhow::Result<_>>()?,
    })
}

fn text(mesh_name: &str, solved: &[Solved], single: bool) -> Vec<String> {
    let mut text = vec![format!("pose of {mesh_name} from {}", counted(solved.len(), "picture"))];
    for one in solved {
        let Solved { path, poses, seconds, .. } = one;
        let FoundPose { camera, iou, psnr } = &one.of_file(&poses[0]);
        let decibels = psnr.map_or_else(String::new, |psnr| format!(", colours {psnr:.1} dB"));
        if !single {
            text.push(line(
                &path.display().to_string(),
                &format!(
                    "IoU {iou:.4}{decibels}, {}, {seconds:.1} s",
                    counted(poses.len() - 1, "alternative")
                ),
            ));
            continue;
        }
        text.push(line("IoU", &format!("{iou:.4}{decibels}")));
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
    let head = "picture,rank,iou,r11,r12,r13,r21,r22,r23,r31,r32,r33,t1,t2,t3,fx,fy,cx,cy,psnr\n"
        .to_owned();
    solved.iter().fold(head, |text, one| {
        let name = one.path.display().to_string().replace('"', "\"\"");
        one.poses.iter().enumerate().fold(text, |text, (rank, pose)| {
            let FoundPose { camera, iou, psnr } = &one.of_file(pose);
            let Pinhole { rotation, translation, focal, centre, .. } = camera;
            let numbers = [&[*iou], rotation.as_flattened(), translation, focal, centre].concat();
            let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
            let psnr = psnr.map_or_else(String::new, |psnr| psnr.to_string());
            format!("{text}\"{name}\",{rank},{},{psnr}\n", numbers.join(","))
        })
    })
}

fn of_camera(pose: &FoundPose) -> Table {
    let camera = &pose.camera;
    let row =
        |values: &[f64]| values.iter().map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(", ");
    let mut pairs = vec![["IoU".to_owned(), format!("{:.4}", pose.iou)]];
    pairs.extend(pose.psnr.map(|psnr| ["colours, PSNR".to_owned(), format!("{psnr:.1} dB")]));
    for (k, values) in camera.rotation.iter().enumerate() {
        pairs.push([format!("R, row {}", k + 1), row(values)]);
    }
    pairs.push(["t".to_owned(), row(&camera.translation)]);
    pairs.push(["fx, fy, cx, cy".to_owned(), row(&[camera.focal, camera.centre].concat())]);
    Table::pairs(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_has_an_overlay_of_its_own() {
        let names = ["a.jpg", "a.png", "a.jpg.png", "a.png.png", "A.png", "a.png-2.png"];
        let overlays = overlay_names(&names.map(PathBuf::from), false);
        assert_eq!(overlays[..2], ["overlay-a.jpg.png", "overlay-a.png"]);
        let apart: HashSet<String> = overlays.iter().map(|name| name.to_lowercase()).collect();
        assert_eq!(apart.len(), names.len(), "{overlays:?}");
    }
}
