//! The report on a mesh fitted to views, and the files written with it.

use std::path::PathBuf;

use image::RgbImage;
use serde_json::{Value, json};
use softrast_cli::{Answer, Given, viewer};
use softrast_lab::{
    contact_sheet,
    format::{counted, fit, line},
    png,
    program::Output,
    report::{Beside, Labelled, Report, Table},
};
use softrast_mesh::Mesh;
use softrast_views::{View, faces_across_note};

use super::{painted::Colours, textured::Textured};
use crate::Args;

/// Files of every result, and of a result in colour.
const MESHES: [&str; 3] = ["mesh.obj", "mesh.ply", "mesh.glb"];
const VIEWS: &str = "views.png";
const IN_COLOUR: [&str; 5] =
    ["colours.png", "textured.glb", "textured.obj", "textured.mtl", "textured.png"];

/// Names of all files of a result.
pub(super) fn names(in_colour: bool) -> impl Iterator<Item = &'static str> {
    MESHES.into_iter().chain([VIEWS]).chain(IN_COLOUR.into_iter().filter(move |_| in_colour))
}

/// Largest number of views in a picture of the result.
const SHOWN: usize = 12;

/// A view, how well the result fits it, and whether it was held out.
pub(super) struct Scored {
    pub(super) view: View,
    /// The silhouette over the mask, for a page.
    pub(super) overlay: RgbImage,
    pub(super) iou: f64,
    /// The colours, if requested.
    pub(super) colours: Option<Colours>,
    pub(super) held_out: bool,
}

impl Scored {
    fn psnr(&self) -> Option<f64> {
        self.colours.as_ref()?.psnr
    }

    fn psnr_of_vertices(&self) -> Option<f64> {
        self.colours.as_ref()?.psnr_of_vertices
    }

    /// In words.
    fn scores(&self) -> String {
        let psnr = self.psnr().map(|psnr| format!(", PSNR {psnr:.2} dB")).unwrap_or_default();
        format!("IoU {:.4}{psnr}{}", self.iou, if self.held_out { ", held out" } else { "" })
    }
}

/// The mean of a score over the held-out views, or over the others.
fn mean(scored: &[Scored], held_out: bool, score: impl Fn(&Scored) -> Option<f64>) -> Option<f64> {
    let of: Vec<f64> =
        scored.iter().filter(|one| one.held_out == held_out).filter_map(score).collect();
    (!of.is_empty()).then(|| of.iter().sum::<f64>() / of.len() as f64)
}

/// Scores of a mesh, and its path.
struct Summary {
    train: f64,
    held_out: Option<f64>,
    /// In decibels, of the training and held-out views.
    psnr: [Option<f64>; 2],
    /// PSNR of the colours of vertices, of these two parts.
    psnr_of_vertices: [Option<f64>; 2],
    /// Texels a side of the texture, and its charts.
    texture: Option<[usize; 2]>,
    path: PathBuf,
    /// Pairs of faces that pass through each other.
    crossing: usize,
    seconds: f64,
}

/// Pictures of the shown views, in their order, and contact sheets of them as PNG.
struct Pictures {
    overlays: Vec<RgbImage>,
    pairs: Vec<[RgbImage; 2]>,
    views: Vec<u8>,
    colours: Option<Vec<u8>>,
}

impl Pictures {
    fn new(scored: &[Scored]) -> anyhow::Result<Self> {
        let overlays: Vec<RgbImage> = shown(scored).map(|one| one.overlay.clone()).collect();
        let pairs: Vec<[RgbImage; 2]> =
            shown(scored).filter_map(|one| Some(one.colours.as_ref()?.pair.clone())).collect();
        let views = png(&contact_sheet(&overlays, 4.min(overlays.len())))?;
        let colours = || png(&contact_sheet(pairs.as_flattened(), 4));
        let colours = (!pairs.is_empty()).then(colours).transpose()?;
        Ok(Self { overlays, pairs, views, colours })
    }
}

pub(super) fn answer(
    given: &Given<'_, Args>,
    mesh: &Mesh,
    textured: Option<&Textured>,
    scored: &[Scored],
    notes: Vec<String>,
    seconds: f64,
) -> anyhow::Result<Answer> {
    let iou = |one: &Scored| Some(one.iou);
    let summary = Summary {
        train: mean(scored, false, iou).unwrap_or(f64::NAN),
        held_out: mean(scored, true, iou),
        psnr: [false, true].map(|held_out| mean(scored, held_out, Scored::psnr)),
        psnr_of_vertices: [false, true]
            .map(|held_out| mean(scored, held_out, Scored::psnr_of_vertices)),
        texture: textured.and_then(|textured| textured.found),
        path: given.folder().join(MESHES[0]),
        crossing: mesh.self_intersections().len(),
        seconds,
    };
    let mut warnings = notes;
    let cameras = scored.iter().map(|one| (&one.view.name, one.view.camera));
    warnings.extend(faces_across_note(mesh, cameras, 0.0));
    if summary.train < 0.9 && given.args.mesh.is_some() {
        warnings.push(format!(
            "the mean IoU is {:.3} only: the mesh is taken as it stands, in the world units of the cameras; check that it lies where the \
             pictures show it",
            summary.train
        ));
    } else if summary.train < 0.9 {
        warnings.push(format!(
            "the mean IoU is {:.3} only: check that the cameras belong to the pictures and that the masks are white where the object is \
             (--invert)",
            summary.train
        ));
    }
    if summary.crossing > 0 && given.args.mesh.is_none() {
        warnings.push(format!("{} pairs of faces pass through each other", summary.crossing));
    }
    let pictures = Pictures::new(scored)?;
    let text = text(mesh, scored, &summary);
    let page = page(mesh, scored, &summary, &warnings, &pictures)?;
    let json = json(mesh, scored, &summary, &warnings);
    let mut beside = Vec::new();
    let mut files = vec![
        (MESHES[0].to_owned(), mesh.to_obj().into_bytes()),
        (MESHES[1].to_owned(), mesh.to_ply()),
        (MESHES[2].to_owned(), mesh.to_glb()),
        (VIEWS.to_owned(), pictures.views),
    ];
    if let Some(colours) = pictures.colours {
        files.push((IN_COLOUR[0].to_owned(), colours));
    }
    if let Some(textured) = textured {
        let [_, glb, obj, mtl, png] = IN_COLOUR;
        files.push((glb.to_owned(), textured.mesh.to_glb()));
        files.push((obj.to_owned(), textured.obj(mtl).into_bytes()));
        files.push((mtl.to_owned(), Textured::mtl(png).into_bytes()));
        files.push((png.to_owned(), textured.picture().to_vec()));
        beside.push(Beside::new(glb, "the mesh with a texture, for viewers and engines"));
        beside.push(Beside::new(obj, "the same as text, with textured.mtl and textured.png"));
    }
    let holds = ["the mesh as text", "the mesh for mesh tools", "the mesh for viewers and engines"];
    beside.extend(MESHES.into_iter().zip(holds).map(|(file, holds)| Beside::new(file, holds)));
    beside.push(Beside::new("result.json", "the scores of every view"));
    let output = Output { text, json, warnings, partial: None };
    Ok(Answer { page, output, files, beside })
}

fn text(mesh: &Mesh, scored: &[Scored], summary: &Summary) -> Vec<String> {
    let Summary { train, held_out, psnr: [psnr, aside_psnr], path, seconds, .. } = summary;
    let (vertices, faces) = (mesh.positions().len(), mesh.faces().len());
    let head = [
        format!("3D SHAPE from {}", counted(scored.len(), "view")),
        line("IoU", &format!("{train:.4}")),
    ];
    let rest = [line("mesh", &format!("{}, {vertices} vertices, {faces} faces", path.display()))];
    let origin = mesh.glb_origin();
    let glb = (origin != [0.0; 3]).then(|| {
        let [x, y, z] = origin;
        line("mesh.glb", &format!("vertices in 32 bits, moved by its node to {x} {y} {z}"))
    });
    let seconds = line("seconds", &format!("{seconds:.1}"));
    let aside = held_out.map(|iou| line("IoU, held out", &format!("{iou:.4}")));
    let psnr = psnr.map(|psnr| line("PSNR", &format!("{psnr:.2} dB")));
    let aside_psnr = aside_psnr.map(|psnr| line("PSNR, held out", &format!("{psnr:.2} dB")));
    let scores = head.into_iter().chain(aside).chain(psnr).chain(aside_psnr);
    scores.chain(rest).chain(glb).chain([seconds]).collect()
}

/// Verdict on the fit of the mesh, in a sentence or two.
fn verdict(mesh: &Mesh, summary: &Summary) -> String {
    let Summary { train, held_out, psnr, seconds, .. } = summary;
    let aside = held_out.map_or_else(String::new, |iou| format!(", {iou:.4} in views held out"));
    let colours = match psnr {
        [Some(psnr), None] => format!(" Its colours have a PSNR of {psnr:.1} dB."),
        [_, Some(psnr)] => format!(" Its colours have a PSNR of {psnr:.1} dB in views held out."),
        [None, None] => String::new(),
    };
    let (vertices, faces) = (mesh.positions().len(), mesh.faces().len());
    format!(
        "The mesh {} the masks (IoU {train:.4}{aside}).{colours} {vertices} vertices, {faces} faces, {seconds:.1} s.",
        fit(*train)
    )
}

fn page(
    mesh: &Mesh,
    scored: &[Scored],
    summary: &Summary,
    warnings: &[String],
    pictures: &Pictures,
) -> anyhow::Result<Report> {
    let about = match pictures.colours {
        Some(_) => "A mesh that has the silhouettes and colours of given pictures",
        None => "A mesh that has the silhouettes of given masks",
    };
    let mut page = Report::new("shape3d", about);
    page.verdict(&verdict(mesh, summary));
    page.warnings(warnings);
    let views = scored
        .iter()
        .map(|one| (one.view.name.clone(), &one.view.camera, &one.view.mask, one.scores()));
    page.viewer(
        &viewer(mesh, views, None)?,
        pictures.colours.as_ref().unwrap_or(&pictures.views),
        "The mesh and the cameras. Choose a view to look through its camera, with the outline of the mask.",
    );
    page.heading("Views");
    let (mut overlays, mut pairs) = (Vec::new(), Vec::new());
    for (one, overlay) in shown(scored).zip(&pictures.overlays) {
        let label = format!("{}: {}", one.view.name, one.scores());
        overlays.push(Labelled { picture: png(overlay)?, label });
    }
    for (one, pair) in shown(scored).zip(&pictures.pairs) {
        for (image, what) in pair.iter().zip(["photograph", "mesh"]) {
            let label = format!("{}: {what}", one.view.name);
            pairs.push(Labelled { picture: png(image)?, label });
        }
    }
    let which = match overlays.len() == scored.len() {
        true => String::new(),
        false => format!(" {} of {} views are shown.", overlays.len(), scored.len()),
    };
    if !pairs.is_empty() {
        page.gallery(
            &pairs,
            &format!("Each photograph where its mask is, and the mesh from there.{which}"),
        );
    }
    page.gallery(
        &overlays,
        &format!(
            "The silhouette of the mesh over each mask: grey where both are, orange where only the mask is, blue where only the silhouette \
             is.{which}"
        ),
    );
    page.table(&table(scored, pictures.colours.is_some()));
    Ok(page)
}

/// Table of the scores, with held-out views first, like the pictures.
fn table(scored: &[Scored], in_colour: bool) -> Table {
    let any_held_out = scored.iter().any(|one| one.held_out);
    let head = ["view", "IoU"].into_iter().chain(in_colour.then_some("PSNR in dB"));
    let mut table = Table::new(head.chain(any_held_out.then_some("held out")));
    let [aside, fitted] =
        [true, false].map(|aside| scored.iter().filter(move |one| one.held_out == aside));
    for one in aside.chain(fitted) {
        let row = [one.view.name.clone(), format!("{:.4}", one.iou)];
        let psnr = in_colour.then(|| one.psnr().map(|x| format!("{x:.2}")).unwrap_or_default());
        let aside = any_held_out.then(|| if one.held_out { "yes" } else { "" }.to_owned());
        table.push(row.into_iter().chain(psnr).chain(aside));
    }
    table
}

fn json(mesh: &Mesh, scored: &[Scored], summary: &Summary, warnings: &[String]) -> Value {
    let Summary { train, held_out, psnr, path, crossing, seconds, .. } = summary;
    let mut json = json!({
        "train_iou": train,
        "held_out_iou": held_out,
        "mesh": softrast_lab::shown(path),
        "glb_origin": mesh.glb_origin(),
        "vertices": mesh.positions().len(),
        "faces": mesh.faces().len(),
        "self_intersections": crossing,
        "seconds": seconds,
        "views": scored.iter().map(|one| json!({
            "name": one.view.name,
            "iou": one.iou,
            "held_out": one.held_out,
        })).collect::<Vec<_>>(),
        "warnings": warnings,
    });
    if mesh.colours().is_some() {
        (json["train_psnr"], json["held_out_psnr"]) = (json!(psnr[0]), json!(psnr[1]));
        let [train, held_out] = summary.psnr_of_vertices;
        json["psnr_of_vertices"] = json!({"train": train, "held_out": held_out});
        json["texture"] =
            json!(summary.texture.map(|[size, charts]| json!({"size": size, "charts": charts})));
        for (view, one) in json["views"].as_array_mut().into_iter().flatten().zip(scored) {
            view["psnr"] = json!(one.psnr());
        }
    }
    json
}

/// Held-out views, then others evenly spaced, at most [`SHOWN`].
fn shown(scored: &[Scored]) -> impl Iterator<Item = &Scored> {
    let aside = scored.iter().filter(|one| one.held_out);
    let train: Vec<&Scored> = scored.iter().filter(|one| !one.held_out).collect();
    let every = train.len().div_ceil(SHOWN);
    aside.take(SHOWN).chain(train.into_iter().step_by(every.max(1))).take(SHOWN)
}
