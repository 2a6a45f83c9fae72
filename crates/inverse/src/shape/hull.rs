use rayon::prelude::*;
use softrast_mesh::Mesh;
use softrast_views::{View, VisualHull, mask_iou};

use crate::silhouette_pixels;

/// Cells of the visual hull along its longest side, from few to many: thin parts need more of them.
const CELLS: [usize; 3] = [32, 45, 64];
/// Increase of the hull's mean `IoU` that makes more cells worth their time.
const GROWS: f64 = 0.01;

/// The [`visual_hull`](softrast_views::visual_hull) of views in as few cells as reproduce the masks, as a start for a
/// [`ShapeFit`](super::ShapeFit).
///
/// # Errors
///
/// The errors of [`visual_hull`](softrast_views::visual_hull).
pub fn fitting_hull(views: &[View]) -> anyhow::Result<Mesh> {
    let hull = VisualHull::new(views)?;
    let with = |cells: usize| {
        let mesh = hull.mesh(cells)?;
        let iou = |view: &View| mask_iou(&silhouette_pixels(&mesh, &view.camera), &view.mask);
        let each: Vec<f64> = views.par_iter().map(iou).collect();
        anyhow::Ok((mesh, each.iter().sum::<f64>() / views.len() as f64))
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
