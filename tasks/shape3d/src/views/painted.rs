//! Colours of a mesh whose shape has been found, or is known.

use image::RgbImage;
use softrast_cli::{Given, beside};
use softrast_inverse::{SolveConfig, paint};
use softrast_mesh::Mesh;
use softrast_views::{PaintedView, coloured_pixels};

use super::textured::Textured;
use crate::Args;

/// On spot with its shape known, 30 steps at 0.1 end at 31.4 dB on held-out views, 40 at 0.05 at 32.6, 60 at 34.3.
const STEPS: usize = 60;
const LEARNING_RATE: f64 = 0.05;
/// Pixels a side. With 192 instead of 128 spot gains 0.1 dB.
const SIZE: usize = 128;

/// A view in colour, and the result from there.
pub(super) struct Colours {
    /// PSNR of the texture in decibels, or else of the colours of vertices.
    pub(super) psnr: Option<f64>,
    /// PSNR of the colours of vertices.
    pub(super) psnr_of_vertices: Option<f64>,
    /// The picture and the result over black, for a page.
    pub(super) pair: [RgbImage; 2],
}

impl Colours {
    /// Colours of a mesh with colours at its vertices, and of one with the texture.
    pub(super) fn new(view: &PaintedView, mesh: &Mesh, textured: Option<&Textured>) -> Self {
        let camera = &view.view.camera;
        let of_vertices = coloured_pixels(mesh, camera);
        let psnr_of_vertices = view.psnr_of(&of_vertices);
        let drawn = textured.and_then(|textured| textured.pixels(camera)).unwrap_or(of_vertices);
        let psnr = view.psnr_of(&drawn);
        Self { psnr, psnr_of_vertices, pair: beside(view, drawn) }
    }
}

/// How many steps are taken, and on how many pixels.
pub(super) fn config(given: &Given<'_, Args>) -> SolveConfig {
    let (steps, size) = (given.common.steps, given.common.size);
    SolveConfig {
        size: size.unwrap_or(SIZE),
        steps: steps.unwrap_or(STEPS),
        learning_rate: LEARNING_RATE,
    }
}

/// The mesh in the colours of these views.
pub(super) fn painted(
    given: &Given<'_, Args>,
    mesh: &Mesh,
    views: &[PaintedView],
    visit: impl FnMut(usize, f64) -> anyhow::Result<()>,
) -> anyhow::Result<Mesh> {
    paint(mesh, views, &config(given), visit)
}
