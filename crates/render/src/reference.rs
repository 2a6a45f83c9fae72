//! The reference: every pixel-face pair by tensor ops in f64, a part of the faces at a time.

use std::time::Instant;

use indicatif::ProgressBar;
use rayon::prelude::*;
use softrast_raster::{mse_loss, project, reference};
use softrast_tensor::{Autodiff, NdArray, Tensor};

use crate::scene::{Scene, Step};

type B = NdArray<f64>;
type A = Autodiff<B>;

/// Name of the backend and its float type.
pub(crate) const BACKEND: &str = "ndarray f64, every pair";

/// Pixel-face pairs of one part. Sums over faces, and their gradients, are sums over the parts.
const PART: usize = 1 << 23;

/// Draws the scene once, and differentiates if it has a target.
pub(crate) fn step(scene: &Scene, quiet: bool) -> Step {
    let start = Instant::now();
    let vertices = scene.vertices::<A>().require_grad();
    let projected = project(vertices.clone(), scene.orbits::<A>()).tensor();
    let corners = projected.clone().inner();
    let phi = || scene.phi::<B>();
    let sums = in_parts(scene, quiet, |part| {
        reference::sums(part, corners.clone(), &scene.softness, scene.t_conorm, phi())
    });
    let sums = Tensor::<A, 3>::from_inner(sums).require_grad();
    let image = scene.t_conorm.coverage(sums.clone());
    let forward_ms = milliseconds(start);

    let start = Instant::now();
    let loss = scene.target::<A>().map(|target| {
        let loss = mse_loss(image.clone(), target).mean();
        let upstream = sums.grad(&loss.backward()).expect("the loss depends on the sums");
        let grad = in_parts(scene, quiet, |part| {
            let (corners, upstream) = (corners.clone(), upstream.clone());
            reference::vjp(part, corners, &scene.softness, scene.t_conorm, phi(), upstream)
        });
        let pulled = (projected * Tensor::from_inner(grad)).sum();
        let grad = vertices.grad(&pulled.backward()).expect("the pixels depend on the vertices");
        let norm = grad.to_data().iter::<f64>().map(|g| g * g).sum::<f64>().sqrt();
        [loss.into_scalar(), norm]
    });
    let backward_ms = loss.map(|_| milliseconds(start));
    let image = image.inner().to_data().iter().collect();
    Step::of_silhouettes(image, loss, forward_ms, backward_ms)
}

/// The sum of `of` over all parts of the scene's faces, in the order of the faces.
fn in_parts(
    scene: &Scene,
    quiet: bool,
    of: impl Fn(reference::Scene) -> Tensor<B, 3> + Sync,
) -> Tensor<B, 3> {
    let pixels = scene.views() * scene.size * scene.size;
    let parts: Vec<&[[u32; 3]]> =
        scene.faces.chunks((PART / pixels).clamp(1, scene.faces.len())).collect();
    let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(parts.len() as u64) };
    let part = |faces: &&[[u32; 3]]| {
        let result = of(reference::Scene { faces, size: scene.size.into() });
        bar.inc(1);
        result
    };
    // No more images at a time than there are threads.
    let waves = parts.chunks(rayon::current_num_threads());
    let sum_of = |wave: &[&[[u32; 3]]]| {
        let results: Vec<_> = wave.par_iter().map(part).collect();
        results.into_iter().reduce(|total, result| total + result)
    };
    let total = waves.filter_map(sum_of).reduce(|total, result| total + result);
    bar.finish_and_clear();
    total.expect("a mesh has at least one face")
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
