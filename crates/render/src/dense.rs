//! The reference: every pixel-face pair by tensor ops in f64, a part of the faces at a time.

use std::{
    ops::Range,
    sync::atomic::{AtomicUsize, Ordering},
    time::{Duration, Instant},
};

use burn::{
    backend::{Autodiff, NdArray},
    tensor::{DType, Tensor},
};
use rayon::prelude::*;
use softrast_raster::{mse_loss, project, reference};
use softrast_runner::median;

use crate::{measured::Measured, scene::Scene};

type B = NdArray<f64>;
type A = Autodiff<B>;

/// Name of the backend and its float type.
pub(crate) const BACKEND: &str = "ndarray f64, every pair";

/// Pixel-face pairs of one part. Sums over faces, and their gradients, are sums over the parts.
const PART: usize = 1 << 23;
/// Time between two lines of progress.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Draws the scene `repeat` times, with progress on stderr.
pub(crate) fn measure(scene: &Scene, repeat: usize) -> Measured {
    let runs: Vec<Measured> = (0..repeat).map(|_| step(scene)).collect();
    let times = |of: fn(&Measured) -> f64| median(&runs.iter().map(of).collect::<Vec<_>>());
    let forward_ms = times(|run| run.forward_ms);
    let total_ms = times(|run| run.total_ms);
    let backward_ms = times(|run| run.backward_ms.unwrap_or(0.0));
    let last = runs.into_iter().last().expect("at least one run");
    Measured { forward_ms, backward_ms: last.loss.map(|_| backward_ms), total_ms, ..last }
}

fn step(scene: &Scene) -> Measured {
    let start = Instant::now();
    let vertices = scene.vertices::<A>(DType::F64).require_grad();
    let projected = project(vertices.clone(), scene.orbits::<A>(DType::F64));
    let corners = projected.clone().inner();
    let phi = || scene.phi::<B>(DType::F64);
    let sums = in_parts(scene, "image", |part| {
        reference::sums(part, corners.clone(), &scene.softness, scene.t_conorm, phi())
    });
    let sums = Tensor::<A, 3>::from_inner(sums).require_grad();
    let image = scene.t_conorm.coverage(sums.clone());
    let forward_ms = milliseconds(start);

    let start = Instant::now();
    let loss = scene.target::<A>(DType::F64).map(|target| {
        let loss = mse_loss(image.clone(), target).mean();
        let upstream = sums.grad(&loss.backward()).expect("the loss depends on the sums");
        let grad = in_parts(scene, "gradient", |part| {
            let (corners, upstream) = (corners.clone(), upstream.clone());
            reference::vjp(part, corners, &scene.softness, scene.t_conorm, phi(), upstream)
        });
        let pulled = (projected * Tensor::from_inner(grad)).sum();
        let grad = vertices.grad(&pulled.backward()).expect("the pixels depend on the vertices");
        let norm = grad.to_data().iter::<f64>().map(|g| g * g).sum::<f64>().sqrt();
        [loss.into_scalar(), norm]
    });
    let backward_ms = milliseconds(start);
    Measured {
        alpha: image.inner().to_data().iter().collect(),
        loss,
        pairs: scene.views() * scene.size * scene.size * scene.faces.len(),
        culled: None,
        forward_ms,
        backward_ms: Some(backward_ms),
        total_ms: forward_ms + if loss.is_some() { backward_ms } else { 0.0 },
        profile: None,
    }
}

/// The sum of `of` over all parts of the scene's faces, in the order of the faces.
fn in_parts(
    scene: &Scene,
    name: &str,
    of: impl Fn(reference::Scene) -> Tensor<B, 3> + Sync,
) -> Tensor<B, 3> {
    let pixels = scene.views() * scene.size * scene.size;
    let faces = (PART / pixels).clamp(1, scene.faces.len());
    let starts: Vec<usize> = (0..scene.faces.len()).step_by(faces).collect();
    let progress = Progress::new(name, starts.len());
    let part = |&start: &usize| {
        let range: Range<usize> = start..(start + faces).min(scene.faces.len());
        let result = of(reference::Scene { faces: &scene.faces[range], size: scene.size });
        progress.done();
        result
    };
    // No more images at a time than there are threads.
    let mut total: Option<Tensor<B, 3>> = None;
    for starts in starts.chunks(rayon::current_num_threads()) {
        let results: Vec<_> = starts.par_iter().map(part).collect();
        total = results.into_iter().fold(total, |total, result| match total {
            Some(total) => Some(total + result),
            None => Some(result),
        });
    }
    total.expect("a mesh has at least one face")
}

/// How far a pass is, as lines on stderr.
struct Progress<'a> {
    name: &'a str,
    parts: usize,
    done: AtomicUsize,
    lines: AtomicUsize,
    start: Instant,
}

impl<'a> Progress<'a> {
    fn new(name: &'a str, parts: usize) -> Self {
        let zero = || AtomicUsize::new(0);
        Self { name, parts, done: zero(), lines: zero(), start: Instant::now() }
    }

    fn done(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        let seconds = self.start.elapsed().as_secs_f64();
        let due = (seconds / LINE_EVERY.as_secs_f64()) as usize;
        if self.lines.fetch_max(due, Ordering::Relaxed) < due {
            let left = seconds * (self.parts as f64 / done as f64 - 1.0);
            eprintln!("{}: {} %, {left:.0} s left", self.name, 100 * done / self.parts);
        }
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
