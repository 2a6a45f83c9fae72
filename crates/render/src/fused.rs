//! The fused op on the backend of the program, timed.

use std::time::Instant;

use burn::{
    backend::Autodiff,
    tensor::{DType, ElementConversion, Tensor},
};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette, mse_loss, project};
use softrast_runner::median;
use softrast_softness::EdgeSoftness;

use crate::{
    measured::{Knots, Measured},
    scene::Scene,
};

/// Draws the scene `repeat` times, after once to warm up.
pub(crate) fn measure<B: RasterBackend>(scene: &Scene, repeat: usize) -> Measured {
    let fused = Fused::<B>::new(scene);
    let mut last = fused.step();
    let steps: Vec<Step<B>> = (0..repeat)
        .map(|_| {
            last = fused.step();
            last.clone()
        })
        .collect();
    let times = |of: fn(&Step<B>) -> f64| median(&steps.iter().map(of).collect::<Vec<_>>());
    let pairs = fused.pairs(&fused.silhouette);
    Measured {
        alpha: last.image.to_data().iter().collect(),
        loss: last.loss,
        pairs,
        culled: Some(fused.culled(scene, pairs)),
        forward_ms: times(|step| step.forward_ms),
        backward_ms: last.loss.map(|_| times(|step| step.backward_ms)),
        total_ms: times(|step| step.forward_ms + step.backward_ms),
        profile: Some(fused.knots()),
    }
}

/// What stays the same from step to step.
struct Fused<B: RasterBackend> {
    silhouette: Silhouette<EdgeSoftness>,
    prepare_ms: f64,
    table: Tensor<B, 2>,
    vertices: Tensor<B, 3>,
    orbits: Tensor<B, 2>,
    target: Option<Tensor<B, 3>>,
}

/// One image, its loss and gradient norm if there is a target, and what they took.
#[derive(Clone)]
struct Step<B: RasterBackend> {
    image: Tensor<B, 3>,
    loss: Option<[f64; 2]>,
    forward_ms: f64,
    backward_ms: f64,
}

impl<B: RasterBackend> Fused<B> {
    fn new(scene: &Scene) -> Self {
        let &Scene { size, tolerance, t_conorm, .. } = scene;
        let start = Instant::now();
        let phi = scene.phi::<B>(DType::F32);
        let rasterizer = Rasterizer { size, tolerance, t_conorm };
        let silhouette = rasterizer.prepare(&scene.faces, scene.softness, &phi);
        let table = silhouette.table(phi);
        let prepare_ms = milliseconds::<B>(start);
        Self {
            silhouette,
            prepare_ms,
            table,
            vertices: scene.vertices(DType::F32),
            orbits: scene.orbits(DType::F32),
            target: scene.target(DType::F32),
        }
    }

    /// Pairs that one pass visits.
    fn pairs(&self, silhouette: &Silhouette<EdgeSoftness>) -> usize {
        silhouette.pairs(project(self.vertices.clone(), self.orbits.clone()))
    }

    /// Share of the pairs which the default tolerance keeps that are not among these `pairs`.
    fn culled(&self, scene: &Scene, pairs: usize) -> f64 {
        let &Scene { size, t_conorm, .. } = scene;
        let rasterizer = Rasterizer { t_conorm, ..Rasterizer::new(size) };
        let phi = scene.phi::<B>(DType::F32);
        let kept = self.pairs(&rasterizer.prepare(&scene.faces, scene.softness, &phi));
        kept.saturating_sub(pairs) as f64 / kept.max(1) as f64
    }

    fn knots(&self) -> Knots {
        let profile = self.silhouette.profile();
        let prepare_ms = self.prepare_ms;
        Knots { count: profile.knots(), support_ndc: profile.support(), prepare_ms }
    }

    fn step(&self) -> Step<B> {
        let [orbits, table] = [&self.orbits, &self.table].map(Clone::clone);
        let start = Instant::now();
        let Some(target) = &self.target else {
            let image = self.coverage(self.vertices.clone(), orbits, table);
            let forward_ms = milliseconds::<B>(start);
            return Step { image, loss: None, forward_ms, backward_ms: 0.0 };
        };
        let vertices = Tensor::<Autodiff<B>, 3>::from_inner(self.vertices.clone()).require_grad();
        let [orbits, table] = [orbits, table].map(Tensor::from_inner);
        let image = self.coverage(vertices.clone(), orbits, table);
        let forward_ms = milliseconds::<B>(start);

        let start = Instant::now();
        let loss = mse_loss(image.clone(), Tensor::from_inner(target.clone())).mean();
        let grad = vertices.grad(&loss.backward()).expect("the image depends on the vertices");
        let backward_ms = milliseconds::<B>(start);
        let norm = grad.to_data().iter::<f64>().map(|g| g * g).sum::<f64>().sqrt();
        let loss = loss.into_scalar().elem();
        Step { image: image.inner(), loss: Some([loss, norm]), forward_ms, backward_ms }
    }

    /// From world vertices to coverage.
    fn coverage<C: RasterBackend>(
        &self,
        vertices: Tensor<C, 3>,
        orbits: Tensor<C, 2>,
        table: Tensor<C, 2>,
    ) -> Tensor<C, 3> {
        self.silhouette.coverage_by_table(project(vertices, orbits), table)
    }
}

/// Time since `start`, once the device has done what it was asked.
fn milliseconds<B: RasterBackend>(start: Instant) -> f64 {
    B::sync(&Default::default()).expect("the device finishes its work");
    start.elapsed().as_secs_f64() * 1e3
}
