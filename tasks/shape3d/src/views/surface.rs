//! A surface fitted to views, from their hull or from a sphere.

use anyhow::anyhow;
use softrast_cli::Given;
use softrast_inverse::shape::{ShapeFit, ViewOfShape, fitting_hull};
use softrast_lab::{Error, Progress, program::say, was_interrupted};
use softrast_mesh::Mesh;
use softrast_views::{PaintedView, View};

use super::flags::{Begin, Views};
use crate::Args;

/// Default number of steps.
const STEPS: usize = 500;

/// Number of steps.
pub(super) fn steps(given: &Given<'_, Args>) -> usize {
    given.common.steps.unwrap_or(STEPS)
}

/// The surface fitted to views in a frame, with the colours and the normals of all views or of none. If the user stops the fit, the surface
/// is that of the last step.
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
        let hull = fitting_hull(views);
        let hull =
            hull.map_err(|why| anyhow!("{why:#} (--invert?); --start sphere needs no hull"))?;
        fit = fit.starting_at(hull);
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
