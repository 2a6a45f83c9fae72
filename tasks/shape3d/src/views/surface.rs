//! The surface that views show, from their hull or from a sphere.

use anyhow::anyhow;
use softrast_cli::Given;
use softrast_inverse::{
    shape::{ShapeFit, ViewOfShape},
    silhouette_pixels,
};
use softrast_lab::{Error, Progress, program::say, was_interrupted};
use softrast_mesh::Mesh;
use softrast_views::{PaintedView, View, mask_iou, visual_hull};

use super::flags::{Begin, Views};
use crate::Args;

/// Steps that move the surface.
const STEPS: usize = 500;
/// Cells of the visual hull along its longest side, from few to many: thin parts need more of them.
const CELLS: [usize; 3] = [32, 45, 64];
/// More cells are worth their time if the mean `IoU` of the hull grows by so much.
const GROWS: f64 = 0.01;
/// How many steps are taken.
pub(super) fn steps(given: &Given<'_, Args>) -> usize {
    given.common.steps.unwrap_or(STEPS)
}

/// The surface, of views of a frame; `shown` are their colours and their normals, each of all views or of none. Where the user stops it, it is as it was then.
pub(super) fn found(
    given: &Given<'_, Args>,
    flags: &Views,
    views: &[View],
    [colours, normals]: [&[PaintedView]; 2],
    progress: &mut Progress,
) -> anyhow::Result<Mesh> {
    let of_view = |(k, view): (usize, &View)| {
        let mut of = ViewOfShape::of_mask(view)?;
        if let Some(colours) = colours.get(k) {
            of = of.with_colours(colours);
        }
        Ok(normals.get(k).map_or(of.clone(), |normals| of.with_normals(normals)))
    };
    let of_views = views.iter().enumerate().map(of_view).collect::<anyhow::Result<_>>()?;
    let (steps, mut taken) = (steps(given), 0);
    let mut fit = ShapeFit::new(of_views).with_steps(steps);
    if let Some(size) = given.common.size {
        if size < 8 {
            return Err(Error::usage("--size must be at least 8 with --views"));
        }
        fit = fit.with_size(size);
    }
    if flags.start.unwrap_or_default() == Begin::Hull {
        fit = fit.starting_at(fitting_hull(views)?);
    }
    if let Some(most) = flags.faces {
        fit = fit.with_most_faces(most as usize);
    }
    let found = fit
        .with_smoothing(flags.smooth.unwrap_or(1.0))
        .progress(|step, loss| {
            taken = step;
            progress.step(step, loss)
        })
        .run()?;
    if let Some(why) = found.stopped {
        if !was_interrupted(&why) {
            return Err(why);
        }
        say(&format!("stopped after {taken} of {steps} steps: the mesh is as it was then"));
    }
    Ok(found.mesh)
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
