//! A texture of a surface, found from views of it.

mod fit;
mod texels;
mod unseen;

use anyhow::ensure;
use softrast_mesh::Mesh;
use softrast_views::{PaintedView, TexelReads, Unwrapped};

use self::{texels::Texels, unseen::without_unseen};
use crate::cuts::cuts;

/// Texels a side.
const SIZES: [usize; 2] = [64, 4096];
/// The most that are chosen where nobody asks for a number.
const MOST: usize = 2048;
/// Power of the cosine between the surface and the direction to a camera by which a pixel counts: a view from the side shows it blurred, and where the
/// surface is a little off, another place of it. On spot, held out, 1 gains 0.05 dB over 0, 2 gains 0.06 dB.
const FACING: f64 = 2.0;
/// The part of a square that charts cover, about.
const COVERED: f64 = 0.6;

/// A mesh with a texture that was found.
///
/// The [crate](crate) has an example.
#[derive(Debug)]
pub struct FoundTexture {
    /// The mesh, its faces as they were, without colours of vertices.
    pub mesh: Mesh,
    /// Texels a side.
    pub size: usize,
    /// Parts of the surface that lie beside each other on the picture.
    pub charts: usize,
    /// The error of `told` that ended the search early; the texture is as it was then.
    pub stopped: Option<anyhow::Error>,
}

impl FoundTexture {
    /// How often `told` of [`paint_texture`] is called after its first call.
    pub const STEPS: usize = fit::STEPS;
    /// Fewest and most texels a side.
    pub const SIZES: [usize; 2] = SIZES;
}

/// Texels a side, a power of two, with about one for each pixel of the pictures that shows a place of the mesh from where it is largest.
fn texture_size(mesh: &Mesh, views: &[PaintedView]) -> usize {
    let [low, high] = mesh.bounds();
    let middle = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
    let pixel = |view: &PaintedView| {
        let camera = &view.view.camera;
        let depth = camera.transform(middle)[2];
        if depth > 0.0 { depth / camera.focal[0].max(camera.focal[1]) } else { f64::INFINITY }
    };
    let pixel = views.iter().map(pixel).fold(f64::INFINITY, f64::min);
    let side = (mesh.area() / COVERED).sqrt() / pixel;
    let side = if side.is_finite() { side.ceil() as usize } else { 0 };
    side.clamp(SIZES[0], MOST).next_power_of_two()
}

/// The mesh with a texture found from `views`, of `size` × `size` texels, or of about one for each pixel of the pictures. Its shape stays. Mesh and
/// cameras may be anywhere, in any unit.
///
/// The surface is [`Unwrapped`] into charts, whose margins repeat the colours of their edges. Texels start at the vertex colours of `fine`, the
/// same mesh after some calls of [`Mesh::subdivided`]. The gradient of what the views read of the texels ([`TexelReads`]) brings these to the least squared
/// differences to all views. A pixel counts as much as its mask says, times the squared cosine between the surface and the direction to the camera. Places
/// that no view shows take the colours around them. `told` gets the steps taken and the mean squared difference; its error ends the search and is returned in `stopped`. It runs on the CPU, and its result does not
/// depend on the number of threads.
///
/// # Errors
///
/// If `size` is not one of [`FoundTexture::SIZES`] or between them, or too small for the charts; if there is no view, a mask is empty or full, or the mesh lies behind all cameras;
/// if `fine` has no colours, or is not the mesh after some cuts.
pub fn paint_texture(
    mesh: &Mesh,
    fine: &Mesh,
    views: &[PaintedView],
    size: Option<usize>,
    told: impl FnMut(usize, f64) -> anyhow::Result<()>,
) -> anyhow::Result<FoundTexture> {
    ensure!(fine.colours().is_some(), "a texture starts from colours of vertices");
    let cuts = cuts(mesh, fine)?;
    ensure!(!views.is_empty(), "a texture needs a view");
    let [least, most] = SIZES;
    ensure!(
        size.is_none_or(|size| (least..=most).contains(&size)),
        "a texture has from {least} to {most} texels a side"
    );
    let layout = match size {
        Some(size) => Unwrapped::of(mesh, size)?,
        None => {
            let mut size = texture_size(mesh, views);
            // Margins of many charts take more room than there is for their faces.
            loop {
                match Unwrapped::of(mesh, size) {
                    Err(_) if size < most => size *= 2,
                    layout => break layout?,
                }
            }
        }
    };
    let reads = TexelReads::new(mesh, &layout, views, FACING)?;
    let seen = reads.sees_face();
    let colours = without_unseen(fine, |part| seen[part >> (2 * cuts)]);
    let mut texels = Texels::of(&layout, &fine.clone().with_colours(colours)?, cuts);
    let stopped = fit::fit(&reads, &mut texels, told).err();
    texels.fill();
    let charts = layout.charts();
    let mesh = texels.on(mesh, &layout)?;
    Ok(FoundTexture { mesh, size: layout.size(), charts, stopped })
}
