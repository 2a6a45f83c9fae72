use std::sync::Arc;

use anyhow::{Context, ensure};
use softrast_mesh::{Edges, Mesh};
use softrast_meta::{Adam, InnerLoop, descend};
use softrast_raster::{
    Attributes, ColourRenderer, HostBackend, NEAR, Pinhole, Pinholes, Projected, Width, project,
    vertex_tensor,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family};
use softrast_tensor::{Autodiff, Tensor, numbers, tensor};

use crate::{PaintTargets, SolveConfig, Surface};
use softrast_views::{Frame, PaintedView, Picture};

type B = Autodiff<HostBackend>;

/// Half width of the edge of a face, in pixels. A face outweighs all faces behind it within its support, so the support
/// is small: on spot with known shape, a logistic of 0.15 pixels reaches 28.5 dB, and a step takes 25 times as long.
const EDGE_PX: f64 = 0.1;
/// Scale of the depth softness relative to the longest side of the mesh: below the thickness of thin parts.
const DEPTH: f64 = 0.005;
/// Weight of `Σ |c - mean of its neighbours|² / V` relative to the mean squared difference of
/// colours: so small that only vertices visible in no view take the colours of their neighbours.
const SMOOTH: f64 = 1e-3;
/// Faces are subdivided while they cover more pixels than this on average. On spot with known shape, whose faces cover
/// 1.7 pixels, one more subdivision gains 0.3 dB for two and a half times the time.
const FACE_PX: f64 = 4.0;
/// Margin of the planes of nearness beyond the mesh, as a share of the largest depth.
const BEYOND: f64 = 1e-3;

/// The mesh with vertex colours that fit some views, by gradient descent through a [`ColourRenderer`]. The shape does not change; faces
/// that cover many pixels are subdivided, for more colours. Mesh and cameras may be anywhere, in any unit.
///
/// Each view is compared on the square around its mask, on `config.size` pixels a side. The loss is that of [`PaintTargets`] plus a small
/// smoothness term; colours start at the mean of all views and stay within [0, 1]. `visit` receives the steps taken and the mean squared
/// difference. It runs on the CPU.
///
/// # Errors
///
/// The errors of `visit`, which end the descent; if there is no view, a mask is empty or full, or the mesh is in front of no camera.
pub fn paint(
    mesh: &Mesh,
    views: &[PaintedView],
    config: &SolveConfig,
    visit: impl FnMut(usize, f64) -> anyhow::Result<()>,
) -> anyhow::Result<Mesh> {
    let (painted, stopped) = paint_until_stopped(mesh, views, config, visit)?;
    stopped.map_or(Ok(painted), Err)
}

/// The mesh with colours as [`paint`] finds them. An error of `visit` ends the descent too, and is returned with the colours at that step.
///
/// # Errors
///
/// If there is no view, a mask is empty or full, or no camera has the mesh before it.
pub fn paint_until_stopped(
    mesh: &Mesh,
    views: &[PaintedView],
    config: &SolveConfig,
    mut visit: impl FnMut(usize, f64) -> anyhow::Result<()>,
) -> anyhow::Result<(Mesh, Option<anyhow::Error>)> {
    let SolveConfig { size, steps, learning_rate } = *config;
    let square = |v: &PaintedView| v.view.mask.view_square().with_context(|| v.view.name.clone());
    let squares = views.iter().map(square).collect::<anyhow::Result<Vec<_>>>()?;
    let looks = || views.iter().zip(squares.iter().copied());
    let targets = PaintTargets::<B>::new(looks(), size);
    let mean = mean_colour(views).context("colours need a view in which something counts")?;
    let mesh = cut(mesh.clone(), targets.pixels() / views.len() as f64);
    let (faces, count) = (Arc::<[_]>::from(mesh.faces()), mesh.positions().len());

    let camera = |(v, [left, top, extent]): (&PaintedView, [f64; 3])| {
        v.view.camera.cropped([left, top], [extent; 2], size)
    };
    let cameras: Vec<Pinhole> = looks().map(camera).collect();
    let frame = Frame::of_cameras(&mesh, &cameras);
    let framed = frame.mesh(&mesh);
    let cameras: Vec<Pinhole> = cameras.iter().map(|camera| frame.camera(camera)).collect();
    let device = Default::default();
    let corners = vertex_tensor::<HostBackend>(framed.positions(), &device);
    let seen = project(corners, Pinholes::new(&cameras, &device));
    let renderer = renderer(&framed, size, numbers(seen.clone().tensor().narrow(2, 2, 1)))?;
    let background = renderer.background::<B>(&[0.0; 3], &device);
    let surface = Surface::<B>::of_edges(&Edges::new(&faces), count, &Default::default());

    let start = tensor(mean.map(|channel| vec![channel; count]).concat(), [3 * count]);
    let inner = InnerLoop { optimizer: Adam::new(learning_rate), steps };
    let mut last = None;
    let gradient = |step: usize, theta: &Tensor<HostBackend, 1>| {
        let leaf = Tensor::<B, 1>::from_inner(theta.clone()).require_grad();
        let colours: Tensor<B, 2> = leaf.clone().reshape([3, count]);
        let colours: Tensor<_, 3> = colours.transpose().unsqueeze();
        let attributes = Attributes::new(colours.clone(), faces.clone());
        let image = renderer.image(Projected::from_inner(seen.clone()), &attributes, &background);
        let off = targets.loss(image);
        if let Err(why) = visit(step, numbers(off.clone().inner())[0]) {
            last = Some(theta.clone());
            return Err(why);
        }
        let loss = off + surface.laplacian(colours) * (SMOOTH / count as f64);
        Ok(leaf.grad(&loss.backward()).unwrap_or_else(|| theta.zeros_like()))
    };
    let found = descend(&inner, start, gradient, |theta| theta.clamp(0.0, 1.0), |_, _, _| ());
    let (theta, stopped) = match (found, last) {
        (Ok(theta), _) => (theta, None),
        (Err(why), Some(theta)) => (theta, Some(why)),
        (Err(why), None) => return Err(why),
    };
    let found = numbers(theta);
    let colours = (0..count).map(|v| [0, 1, 2].map(|k| found[k * count + v])).collect();
    Ok((mesh.with_colours(colours)?, stopped))
}

/// The mean colour of all pixels that count; `None` if no pixel counts.
fn mean_colour(views: &[PaintedView]) -> Option<[f64; 3]> {
    let sum = |picture: &Picture| -> f64 { picture.pixels().iter().copied().map(f64::from).sum() };
    let total: f64 = views.iter().map(|view| sum(&view.part)).sum();
    let mut colours = [0.0; 3];
    for view in views {
        for (colour, channel) in colours.iter_mut().zip(view.over_black()) {
            *colour += sum(&channel);
        }
    }
    // A sum of many 32-bit numbers may have a small rounding error.
    (total > 0.0).then(|| colours.map(|colour| (colour / total).clamp(0.0, 1.0)))
}

/// Subdivides the mesh until its faces cover few enough `pixels` on average, where all faces cover this many and half of them are visible.
fn cut(mut mesh: Mesh, pixels: f64) -> Mesh {
    while 2.0 * pixels > FACE_PX * mesh.faces().len() as f64 {
        mesh = mesh.subdivided();
    }
    mesh
}

/// The renderer for a mesh with these vertex depths over all views.
fn renderer(mesh: &Mesh, size: usize, depths: Vec<f64>) -> anyhow::Result<ColourRenderer> {
    let before = depths.into_iter().filter(|&depth| depth >= NEAR);
    let ends = [f64::INFINITY, f64::NEG_INFINITY];
    let [near, far] = before.fold(ends, |[near, far], depth| [near.min(depth), far.max(depth)]);
    ensure!(near <= far, "no camera has the mesh before it: is it where the pictures show it?");
    let planes = [near - BEYOND * far, far + BEYOND * far];
    let [low, high] = mesh.bounds();
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    ensure!(longest > 0.0, "the mesh has no extent: all its vertices are in one place");
    let (edge, width) = (EdgeSoftness::new(Family::Uniform), Width::pixels(EDGE_PX));
    let depth = DepthSoftness::Family(Family::Exp);
    Ok(ColourRenderer::new(mesh.faces(), size, edge, width, planes)
        .with_depth(depth, DEPTH * longest / (planes[1] - planes[0])))
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    #[test]
    fn few_faces_become_many_enough() {
        let ball = icosphere(1);
        assert_eq!(cut(ball.clone(), 160.0), ball);
        assert_eq!(cut(ball.clone(), 161.0), ball.subdivided());
        assert_eq!(cut(ball.clone(), 0.0), ball);
    }
}
