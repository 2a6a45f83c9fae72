//! The definition: burn tensor ops over every pixel-face pair, on any backend, to any order.
//!
//! Slow (about 1.3 kB of memory traffic per pair) and simple; every faster implementation is tested against it.
//!
//! ```
//! use softrast_raster::{HostBackend, Projected, SoftRenderer, TConorm, vertex_tensor};
//! use softrast_raster::reference::{Scene, sums};
//! use softrast_softness::Family;
//! use softrast_tensor::numbers;
//!
//! let (faces, device) = ([[0, 1, 2]], Default::default());
//! let corners = [[-0.5, -0.5, 1.0], [0.5, -0.5, 1.0], [0.0, 0.5, 1.0]];
//! let corners = vertex_tensor::<HostBackend>(&corners, &device);
//! let renderer = SoftRenderer::new(&faces, 8, Family::Logistic, 0.02);
//! let scene = Scene { faces: &faces, size: 8.into() };
//! let t_conorm = TConorm::Probabilistic;
//! let sums = sums(scene, corners.clone(), &Family::Logistic, t_conorm, renderer.phi_tensor(&device));
//! let drawn = numbers(renderer.silhouette(Projected::new(corners)));
//! assert!(numbers(t_conorm.coverage(sums)).iter().zip(&drawn).all(|(a, b)| (a - b).abs() < 2e-5));
//! ```

mod blend;
mod distance;
mod elementary;

use softrast_softness::Softness;
use softrast_tensor::{Autodiff, Backend, Tensor, TensorData};

use crate::{ImageSize, NEAR, TConorm};
pub use blend::blended;
use distance::corners;
pub use distance::signed_distance;
pub use elementary::{iou_loss, mse_loss, orbit_matrices, perspective};

/// Most pixel-face pairs per chunk of [`sums`] and [`vjp`].
const PAIRS: usize = 1 << 18;

/// The faces and image of a drawing: faces over the vertices of every view.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// Corners of each face, as vertex numbers.
    pub faces: &'a [[u32; 3]],
    /// Height and width of the image in pixels.
    pub size: ImageSize,
}

/// Sums of `g(s(d))` over the faces of each pixel: `[views, height, width]`, top row first. `vertices` are `[views, vertices, 3]`, x and y in
/// NDC and depth; `phi` is `[parameters]`.
///
/// Computed in chunks of pixels of one view, so that memory stays bounded; under autodiff the tape still holds all chunks, see [`vjp`] for
/// a gradient that does not. Faces with a vertex nearer than [`NEAR`] are excluded.
pub fn sums<B: Backend>(
    scene: Scene,
    vertices: Tensor<B, 3>,
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: Tensor<B, 1>,
) -> Tensor<B, 3> {
    let views = vertices.dims()[0];
    let chunks = chunks(scene, views);
    let parts = chunks
        .into_iter()
        .map(|(view, pixels)| {
            let vertices = vertices.clone().narrow(0, view, 1);
            chunk_sums(scene, vertices, softness, t_conorm, phi.clone(), &pixels)
        })
        .collect();
    Tensor::cat(parts, 0).reshape([views, scene.size.height, scene.size.width])
}

/// Gradient of `Σ upstream · sums` with respect to the vertices `[views, vertices, 3]`, chunk by chunk, with the memory of one chunk.
/// `upstream` is `[views, height, width]`.
///
/// # Panics
///
/// If `upstream` does not fit the image, or a vertex number of a face is out of range.
pub fn vjp<B: Backend>(
    scene: Scene,
    vertices: Tensor<B, 3>,
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: Tensor<B, 1>,
    upstream: Tensor<B, 3>,
) -> Tensor<B, 3> {
    let [views, count, _] = vertices.dims();
    let phi = Tensor::<Autodiff<B>, 1>::from_inner(phi);
    let upstream = upstream.reshape([views * scene.size.pixels()]);
    let mut start = 0;
    let mut totals: Vec<Option<Tensor<B, 3>>> = vec![None; views];
    for (view, pixels) in chunks(scene, views) {
        let leaf = Tensor::<Autodiff<B>, 3>::from_inner(vertices.clone().narrow(0, view, 1))
            .require_grad();
        let sums = chunk_sums(scene, leaf.clone(), softness, t_conorm, phi.clone(), &pixels);
        let upstream = Tensor::from_inner(upstream.clone().narrow(0, start, pixels.len()));
        start += pixels.len();
        let grads = (sums * upstream).sum().backward();
        if let Some(grad) = leaf.grad(&grads) {
            let total = &mut totals[view];
            *total = Some(total.take().map_or(grad.clone(), |total| total + grad));
        }
    }
    let empty = || vertices.clone().narrow(0, 0, 1) * 0.0;
    let parts = totals.into_iter().map(|total| total.unwrap_or_else(empty)).collect();
    Tensor::cat(parts, 0).reshape([views, count, 3])
}

/// Sums of one chunk, `[pixels]`: `vertices` `[1, vertices, 3]`, pixels of that view.
fn chunk_sums<B: Backend>(
    scene: Scene,
    vertices: Tensor<B, 3>,
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: Tensor<B, 1>,
    pixels: &std::ops::Range<usize>,
) -> Tensor<B, 1> {
    let places = places(&vertices, scene, pixels);
    let distance = signed_distance(vertices.clone(), scene.faces, places);
    let (value, _) = t_conorm.profile(softness, phi, distance);
    let hidden = hidden(vertices, scene.faces).expand(value.dims());
    value.mask_fill(hidden, 0.0).sum_dim(2).reshape([pixels.len()])
}

/// Faces that are not drawn: `[views, 1, faces]`.
fn hidden<B: Backend>(
    vertices: Tensor<B, 3>,
    faces: &[[u32; 3]],
) -> Tensor<B, 3, softrast_tensor::Bool> {
    let [a, b, c] = corners(vertices, faces).map(|[_, _, depth]| depth.lower_elem(NEAR));
    a.bool_or(b).bool_or(c)
}

/// Centres of the given pixels, `[pixels, 2]` in NDC.
fn places<B: Backend>(
    like: &Tensor<B, 3>,
    scene: Scene,
    pixels: &std::ops::Range<usize>,
) -> Tensor<B, 2> {
    let ImageSize { height, width } = scene.size;
    let half = height.min(width) as f64 / 2.0;
    let place = |pixel: usize| {
        let (row, column) = (pixel / width, pixel % width);
        [
            (column as f64 + 0.5 - width as f64 / 2.0) / half,
            (height as f64 / 2.0 - row as f64 - 0.5) / half,
        ]
    };
    let places: Vec<f64> = pixels.clone().flat_map(place).collect();
    let data = TensorData::new(places, [pixels.len(), 2]);
    Tensor::from_data(data, (&like.device(), like.dtype()))
}

/// Views and pixel ranges of at most [`PAIRS`] pairs.
fn chunks(scene: Scene, views: usize) -> Vec<(usize, std::ops::Range<usize>)> {
    let pixels = scene.size.pixels();
    let step = (PAIRS / scene.faces.len().max(1)).clamp(1, pixels);
    let ranges = move || (0..pixels).step_by(step).map(move |at| at..(at + step).min(pixels));
    (0..views).flat_map(|view| ranges().map(move |range| (view, range))).collect()
}
