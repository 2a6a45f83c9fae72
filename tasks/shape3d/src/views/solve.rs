use std::{
    cell::RefCell,
    path::{Path, PathBuf},
};

use anyhow::{Context, ensure};
use softrast_cli::{Answer, Given};
use softrast_inverse::silhouette_pixels;
use softrast_lab::{Error, for_page, format::counted, overlay, program::say};
use softrast_mesh::Mesh;
use softrast_views::{
    CameraFile, PaintedView, View, find_mask, frame_of_masks, mask_iou, reading_notes,
};

use super::{
    answer::{Scored, answer, names},
    flags::{HoldOut, Views},
    painted::{self, Colours},
    surface, template,
    textured::{self, Textured},
};
use crate::Args;

/// The mesh fitted to the masks of a folder, if the flags name one.
pub(crate) fn solve_views(
    given: &Given<'_, Args>,
    flags: &Views,
) -> Option<anyhow::Result<Answer>> {
    if flags.views.is_none() && flags.colour {
        return Some(Err(Error::usage(
            "--colour takes the colours of pictures: name a folder of them with --views",
        )));
    }
    if flags.views.is_none() && flags.masks.is_given() {
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
    let deforms = args.template.is_some()
        || flags.start.is_some()
        || flags.smooth.is_some()
        || flags.faces.is_some();
    if args.mesh.is_some() && deforms {
        return Err(Error::usage(
            "--template, --start, --smooth and --faces say how a shape is found: leave them out where --mesh says what it is",
        ));
    }
    if args.detail.is_some() {
        return Err(Error::usage(
            "--detail has no part in --views: the faces of a surface follow from the pixels (--size, --faces)",
        ));
    }
    if args.template.is_none() && (given.names_softness() || given.learning_rate().is_some()) {
        return Err(Error::usage(
            "with --views, a softness and a learning rate go with --template: a surface that is remeshed has its own",
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
    let normals = match &flags.normals {
        Some(folder) => of_normals(&all, folder.as_deref())?,
        None => Vec::new(),
    };
    let pictures = pictures.chain(normals.iter().map(|view| view.picture.clone()));
    // Faults of pictures are reported before the work.
    let sets: Vec<&Vec<View>> = loaded().collect();
    let (painted, warning) = painted_views(flags, &sets)?;
    let in_colour = !painted.is_empty();
    if flags.texture_size.is_some() && !in_colour {
        let why = warning.unwrap_or_else(|| {
            "add --colour (grey pictures and --normals have no texture otherwise)".to_owned()
        });
        return Err(Error::usage(format!(
            "--texture-size sizes a texture, and there is none: {why}"
        )));
    }
    given.will_write(names(in_colour), reads.into_inner().into_iter().chain(pictures))?;
    let note = cameras.note().map(str::to_owned);
    let notes =
        note.into_iter().chain(warning).chain(loaded().flat_map(|views| reading_notes(views)));
    let notes: Vec<String> = notes.collect();
    let count = if let Some(HoldOut::Count(count)) = flags.hold_out { count } else { 0 };
    let normals = match normals.is_empty() {
        true => normals,
        false => split_held_out(normals, count)?.into_iter().next().unwrap_or_default(),
    };
    let normals = normals.iter().map(PaintedView::load).collect::<anyhow::Result<Vec<_>>>()?;
    let [train, held_out] = split_held_out(all, count)?;
    let mut painted = painted.into_iter();
    let [to_paint, painted_aside] = match painted.next() {
        Some(painted) => split_held_out(painted, count)?,
        None => [Vec::new(), Vec::new()],
    };
    let to_compare = painted.next().unwrap_or(painted_aside);
    let held_out = apart.unwrap_or(held_out);
    let clock = std::time::Instant::now();
    let of_shape = match (&args.mesh, &args.template) {
        (Some(_), _) => 0,
        (None, Some(_)) => template::steps(given),
        (None, None) => surface::steps(given),
    };
    // A fitted surface already has its colours.
    let paints = in_colour && (args.mesh.is_some() || args.template.is_some());
    let of_colours = if paints { painted::config(given).steps } else { 0 };
    let of_texture = if in_colour { textured::STEPS } else { 0 };
    let steps = of_shape + of_colours + of_texture;
    let mut progress = given.progress(steps)?;
    let mut mesh = match (&args.mesh, &args.template) {
        (Some(path), _) => Mesh::load(path)?,
        (None, template) => {
            let frame = frame_of_masks(&train)?;
            let framed = |view: &View| View { camera: frame.camera(&view.camera), ..view.clone() };
            let views: Vec<View> = train.iter().map(framed).collect();
            let found = match template {
                Some(path) => {
                    let template = (Mesh::load(path)?, flags.smooth.unwrap_or(1.0));
                    template::deformed(given, template, &views, &mut progress)?
                }
                None => {
                    let shown = [&to_paint, &normals].map(Vec::as_slice);
                    surface::found(given, flags, &views, shown, &mut progress)?
                }
            };
            frame.mesh_to_world(&found)?
        }
    };
    let mut textured = None;
    if in_colour {
        let painted = match paints {
            true => painted::painted(given, &mesh, &to_paint, |step, loss| {
                progress.step(of_shape + step, loss)
            })?,
            false => mesh.clone(),
        };
        let size = flags.texture_size.map(|size| size as usize);
        textured = Some(Textured::new(&mesh, &painted, &to_paint, size, |step, loss| {
            progress.step(of_shape + of_colours + step, loss)
        })?);
        mesh = painted;
    }
    progress.finish();
    let seconds = clock.elapsed().as_secs_f64();
    let score = |(k, view): (usize, &View), painted: &[PaintedView], held_out: bool| {
        let silhouette = silhouette_pixels(&mesh, &view.camera);
        let iou = mask_iou(&silhouette, &view.mask);
        let colours = painted.get(k).map(|view| Colours::new(view, &mesh, textured.as_ref()));
        let overlay = for_page(overlay(&silhouette, view.mask.pixels(), view.camera.size.width));
        Scored { view: view.clone(), overlay, iou, colours, held_out }
    };
    let train = train.iter().enumerate().map(|view| score(view, &to_paint, false));
    let held_out = held_out.iter().enumerate().map(|view| score(view, &to_compare, true));
    let scored: Vec<Scored> = train.chain(held_out).collect();
    answer(given, &mesh, textured.as_ref(), &scored, notes, seconds)
}

/// The views of each set with the colours of their pictures, if these are asked for, or can all be read and some are not grey: else nothing.
/// And a warning, if some picture cannot be read, so that the masks alone are used.
fn painted_views(
    flags: &Views,
    sets: &[&Vec<View>],
) -> anyhow::Result<(Vec<Vec<PaintedView>>, Option<String>)> {
    if !flags.colour && (flags.masks_only || flags.normals.is_some()) {
        return Ok((Vec::new(), None));
    }
    // A folder may have masks and no pictures.
    let mut all = sets.iter().flat_map(|views| views.iter());
    if !flags.colour && !all.any(|view| view.picture.is_file()) {
        return Ok((Vec::new(), None));
    }
    let load = |views: &&Vec<View>| views.iter().map(PaintedView::load).collect();
    let painted: anyhow::Result<Vec<Vec<PaintedView>>> = sets.iter().map(load).collect();
    let painted = match painted {
        Err(error) if !flags.colour => {
            let warning = format!("the masks alone are used, and no colours: {error:#}");
            return Ok((Vec::new(), Some(warning)));
        }
        painted => painted?,
    };
    if flags.colour {
        return Ok((painted, None));
    }
    if !painted.iter().flatten().any(PaintedView::is_coloured) {
        return Ok((Vec::new(), None));
    }
    say(
        "the pictures have colours, which pull the shape and paint it (--masks-only uses the masks alone)",
    );
    Ok((painted, None))
}

/// The views with pictures of their normals: their own, or those of a folder.
fn of_normals(views: &[View], folder: Option<&Path>) -> anyhow::Result<Vec<View>> {
    let Some(folder) = folder else { return Ok(views.to_vec()) };
    let of = |view: &View| {
        let name = view.picture.to_string_lossy();
        let found = find_mask(folder, &name).with_context(|| {
            format!("{}: no picture in {} has the name of {name}", view.name, folder.display())
        });
        anyhow::Ok(View { picture: found?, ..view.clone() })
    };
    views.iter().map(of).collect()
}

/// Training views, and `hold_out` evenly spaced held-out ones.
fn split_held_out<V>(all: Vec<V>, hold_out: usize) -> anyhow::Result<[Vec<V>; 2]> {
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
