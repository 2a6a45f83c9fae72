//! The report of the poses, and its files.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use image::RgbImage;
use serde_json::{Value, json};
use softrast_cli::Answer;
use softrast_inverse::{
    pose::{FoundPose, Symmetry},
    silhouette_pixels,
};
use softrast_lab::{
    Viewer, contact_sheet, for_page,
    format::{FITS, counted, fit, line},
    overlay, png,
    program::Output,
    report::{Beside, Labelled, Report, Table},
    shown,
};
use softrast_mesh::Mesh;
use softrast_raster::Pinhole;
use softrast_views::{
    Distortion, Frame, PaintedView, Picture, camera_json, coloured_pixels, cut_sides,
};

use super::camera_forms::{in_other_forms, of_camera};

/// Most answers in a picture of many.
const SHOWN: usize = 12;

/// The mesh of the search.
pub(super) struct Framed {
    pub(super) mesh: Mesh,
    pub(super) name: String,
    /// The frame of the search, in coordinates of the file.
    pub(super) frame: Frame,
    /// Whether the search used a given start only.
    pub(super) started: bool,
    /// Rotations that preserve its silhouettes.
    pub(super) symmetries: Vec<Symmetry>,
}

/// A mask and its poses, best first.
pub(super) struct Solved {
    pub(super) path: PathBuf,
    pub(super) mask: Picture,
    /// Distortion of the lens, if any.
    pub(super) distortion: Option<Distortion>,
    /// Its colours, in a search by colour.
    pub(super) painted: Option<PaintedView>,
    pub(super) poses: Vec<FoundPose>,
    pub(super) seconds: f64,
}

impl Solved {
    /// A pose in the coordinates of the mesh's file, with the camera of the picture's file, which may have more pixels than the mask.
    fn of_file(&self, frame: &Frame, pose: &FoundPose) -> FoundPose {
        let camera = frame.camera_to_world(&self.mask.whole_camera(&pose.camera));
        FoundPose { camera, ..*pose }
    }
}

/// The answer for all pictures: `names` are those of their overlays.
pub(super) fn answer(
    mesh: &Framed,
    solved: &[Solved],
    names: &[String],
    warnings: Vec<String>,
    single: bool,
) -> anyhow::Result<Answer> {
    let overlays: Vec<RgbImage> =
        solved.iter().map(|one| drawn(&mesh.mesh, one, &one.poses[0])).collect();
    let page = page(mesh, solved, &overlays, &warnings, single)?;
    let mut files = Vec::new();
    for (name, overlay) in names.iter().zip(&overlays) {
        files.push((name.clone(), png(overlay)?));
    }
    if !single {
        files.push((POSES.to_owned(), csv(&mesh.frame, solved).into_bytes()));
    }
    let json = json(mesh, solved, &warnings, single);
    let output = Output { text: text(mesh, solved, single), json, warnings, partial: None };
    let beside = if single {
        ["the camera and the alternatives", "the mask with the silhouette"]
    } else {
        ["all cameras and alternatives", "a line for each pose"]
    };
    let second = if single { names[0].as_str() } else { POSES };
    let beside = ["result.json", second].into_iter().zip(beside);
    let beside = beside.map(|(file, holds)| Beside::new(file, holds)).collect();
    Ok(Answer { page, output, files, beside })
}

/// A table with a line per pose, for many pictures.
pub(super) const POSES: &str = "poses.csv";

/// Names of the files with mask and silhouette, one per picture: `overlay-NAME.png`, or
/// `overlay-NAME.png-2.png` if an earlier picture has that name, ignoring case.
pub(super) fn overlay_names(pictures: &[PathBuf], single: bool) -> Vec<String> {
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
    mesh: &Framed,
    solved: &[Solved],
    overlays: &[RgbImage],
    warnings: &[String],
    single: bool,
) -> anyhow::Result<Report> {
    let mut page = Report::new("pose", "The camera from which a mesh has the silhouette of a mask");
    page.verdict(&verdict(mesh, solved, single));
    page.warnings(warnings);
    let small: Vec<RgbImage> = overlays.iter().map(|overlay| for_page(overlay.clone())).collect();
    let first = &small[..SHOWN.min(small.len())];
    page.viewer(
        &viewer(&mesh.mesh, solved, single)?,
        &png(&contact_sheet(first, 4.min(first.len())))?,
        "The mesh, and the cameras that were found. Choose a view to look through its camera, with the outline of the mask.",
    );
    if single {
        section(&mut page, mesh, &solved[0], &small[0])?;
    } else {
        let pictures = solved.iter().zip(&small).map(|(one, overlay)| {
            let label = format!("{}: IoU {:.4}", name(&one.path), one.poses[0].iou);
            Ok(Labelled { picture: png(overlay)?, label })
        });
        page.gallery(&pictures.collect::<anyhow::Result<Vec<_>>>()?, OVERLAY);
        page.table(&table(solved));
        for (one, overlay) in solved.iter().zip(&small) {
            let mut filled = Ok(());
            page.folded(&format!("{}: the camera", name(&one.path)), |page| {
                filled = section(page, mesh, one, overlay);
            });
            filled?;
        }
    }
    page.note(
        "R and t are for the mesh as it is in its file, as OpenCV has them: a point p is seen at R p + t, with x right, y down and z ahead.",
    );
    Ok(page)
}

const OVERLAY: &str = "The silhouette of the mesh over the mask: grey where both are, orange where only the mask is, blue where only the silhouette is.";

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The fit of the poses, in a sentence or two.
fn verdict(mesh: &Framed, solved: &[Solved], single: bool) -> String {
    let best = |one: &Solved| one.poses[0].iou;
    if let (true, [one]) = (single, solved) {
        let fits = format!("The pose {} the mask (IoU {:.4}).", fit(best(one)), best(one));
        let others = match one.poses.len() - 1 {
            _ if mesh.started => "Only the given start was refined.".to_owned(),
            0 => "No other pose fits nearly as well.".to_owned(),
            1 => "Another pose fits nearly as well.".to_owned(),
            others => format!("{others} other poses fit nearly as well."),
        };
        return format!("{fits} {others}");
    }
    let fitting = solved.iter().filter(|one| best(one) >= FITS).count();
    let mean = solved.iter().map(best).sum::<f64>() / solved.len() as f64;
    format!(
        "The pose fits the mask in {fitting} of {} pictures (mean IoU {mean:.4}).",
        solved.len()
    )
}

/// The pose of a picture, as a section with pictures and text to copy.
fn section(
    page: &mut Report,
    mesh: &Framed,
    one: &Solved,
    overlay: &RgbImage,
) -> anyhow::Result<()> {
    let Framed { mesh, frame, .. } = mesh;
    let best = one.of_file(frame, &one.poses[0]);
    let label = format!("{}: IoU {:.4}", name(&one.path), best.iou);
    let mut pictures = vec![Labelled { picture: png(overlay)?, label }];
    if let Some(images) = picture_and_mesh(mesh, one) {
        for (image, label) in
            images.into_iter().zip(["The picture, over black", "The mesh in its own colours"])
        {
            pictures.push(Labelled { picture: png(&image)?, label: label.to_owned() });
        }
    }
    page.gallery(&pictures, OVERLAY);
    page.table(&of_camera(&best, frame));
    for (label, text) in in_other_forms(&best.camera, &name(&one.path)) {
        page.copyable(label, &text);
    }
    let others = one.poses[1..].iter().enumerate().map(|(k, pose)| {
        let turned = pose.angle_deg(&one.poses[0]);
        let label =
            format!("Alternative {}: IoU {:.4}, turned by {turned:.0} degrees", k + 1, pose.iou);
        Ok(Labelled { picture: png(&for_page(drawn(mesh, one, pose)))?, label })
    });
    let others = others.collect::<anyhow::Result<Vec<_>>>()?;
    if !others.is_empty() {
        page.gallery(
            &others,
            match one.painted {
                Some(_) => "Other poses that fit nearly as well.",
                None => "Other poses that fit nearly as well: a silhouette does not tell them apart. A symmetric mesh has such poses.",
            },
        );
    }
    Ok(())
}

fn table(solved: &[Solved]) -> Table {
    let mut table = Table::new(["picture", "IoU", "other poses", "their IoU", "seconds"]);
    for Solved { path, poses, seconds, .. } in solved {
        let others: Vec<String> =
            poses[1..].iter().map(|pose| format!("{:.4}", pose.iou)).collect();
        table.push([
            path.display().to_string(),
            format!("{:.4}", poses[0].iou),
            others.len().to_string(),
            others.join(", "),
            format!("{seconds:.1}"),
        ]);
    }
    table
}

fn json(mesh: &Framed, solved: &[Solved], warnings: &[String], single: bool) -> Value {
    let Framed { name, frame, symmetries, .. } = mesh;
    let posed = |one: &Solved, pose: &FoundPose| {
        json!({
            "camera": camera_json(&one.of_file(frame, pose).camera),
            "camera_normalized": camera_json(&one.mask.whole_camera(&pose.camera)),
            "iou": pose.iou,
            "psnr": pose.psnr,
        })
    };
    let mut results: Vec<Value> = Vec::new();
    for one in solved {
        let Solved { path, mask, poses, seconds, .. } = one;
        let mut result = posed(one, &poses[0]);
        result["target"] = shown(path).into();
        result["alternatives"] = poses[1..].iter().map(|pose| posed(one, pose)).collect();
        result["cut_sides"] = json!(cut_sides(mask));
        if let Some(distortion) = &one.distortion {
            result["undistorted"] = distortion.json();
        }
        result["seconds"] = json!(seconds);
        results.push(result);
    }
    let mut json = if single {
        results.swap_remove(0)
    } else {
        let mean = solved.iter().map(|of| of.poses[0].iou).sum::<f64>() / solved.len() as f64;
        json!({ "mean_iou": mean, "pictures": results })
    };
    let turn = |&Symmetry { axis, degrees }: &Symmetry| json!({ "axis": axis, "degrees": degrees });
    json["mesh"] = json!({
        "name": name,
        "middle": frame.middle,
        "scale": 1.0 / frame.unit,
        "symmetries": symmetries.iter().map(turn).collect::<Vec<_>>(),
    });
    json["warnings"] = json!(warnings);
    json
}

/// The silhouette at the pose over the mask.
fn drawn(mesh: &Mesh, one: &Solved, pose: &FoundPose) -> RgbImage {
    let silhouette = silhouette_pixels(mesh, &pose.camera);
    overlay(&silhouette, one.mask.pixels(), pose.camera.size.width)
}

/// The colours of a picture, and those of the mesh at its best pose.
fn picture_and_mesh(mesh: &Mesh, one: &Solved) -> Option<[RgbImage; 2]> {
    let view = one.painted.as_ref()?;
    Some(softrast_cli::beside(view, coloured_pixels(mesh, &one.poses[0].camera)))
}

/// The mesh with all poses; opens with the view of a single one.
fn viewer(mesh: &Mesh, solved: &[Solved], single: bool) -> anyhow::Result<Viewer> {
    let views = solved.iter().flat_map(|Solved { path, mask, poses, .. }| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        poses.iter().enumerate().map(move |(rank, FoundPose { camera, iou, .. })| {
            let name =
                if rank == 0 { name.to_string() } else { format!("{name}, alternative {rank}") };
            (name, camera, mask, format!("IoU {iou:.4}"))
        })
    });
    softrast_cli::viewer(mesh, views, single.then_some(0))
}

fn text(Framed { name, frame, .. }: &Framed, solved: &[Solved], single: bool) -> Vec<String> {
    let mut text = vec![format!("pose of {name} from {}", counted(solved.len(), "picture"))];
    for one in solved {
        let Solved { path, poses, seconds, .. } = one;
        let FoundPose { camera, iou, psnr } = &one.of_file(frame, &poses[0]);
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

fn csv(frame: &Frame, solved: &[Solved]) -> String {
    let head = "picture,rank,iou,r11,r12,r13,r21,r22,r23,r31,r32,r33,t1,t2,t3,fx,fy,cx,cy,psnr\n"
        .to_owned();
    solved.iter().fold(head, |text, one| {
        let name = one.path.display().to_string().replace('"', "\"\"");
        one.poses.iter().enumerate().fold(text, |text, (rank, pose)| {
            let FoundPose { camera, iou, psnr } = &one.of_file(frame, pose);
            let Pinhole { rotation, translation, focal, centre, .. } = camera;
            let numbers = [&[*iou], rotation.as_flattened(), translation, focal, centre].concat();
            let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
            let psnr = psnr.map_or_else(String::new, |psnr| psnr.to_string());
            format!("{text}\"{name}\",{rank},{},{psnr}\n", numbers.join(","))
        })
    })
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
