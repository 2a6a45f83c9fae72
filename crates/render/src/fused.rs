//! The fused op on the program's backend.

use std::time::Instant;

use softrast_raster::{
    RasterBackend,
    low_level::{Rasterizer, Silhouette},
    mse_loss, project,
};
use softrast_softness::EdgeSoftness;
use softrast_tensor::{Autodiff, ElementConversion, Tensor};

use crate::scene::{Scene, Step};

/// State shared by all steps.
pub(crate) struct Fused<B: RasterBackend> {
    silhouette: Silhouette<EdgeSoftness>,
    table: Tensor<B, 2>,
    vertices: Tensor<B, 3>,
    orbits: Tensor<B, 2>,
    target: Option<Tensor<B, 3>>,
    /// Time to choose the knots and fill the table, once per softness.
    pub(crate) prepare_ms: f64,
}

impl<B: RasterBackend> Fused<B> {
    pub(crate) fn new(scene: &Scene) -> Self {
        let &Scene { size, tolerance, t_conorm, .. } = scene;
        let start = Instant::now();
        let phi = scene.phi::<B>();
        let rasterizer = Rasterizer { tolerance, t_conorm, ..Rasterizer::new(size) };
        let silhouette = rasterizer.prepare(&scene.faces, scene.softness, &phi);
        let table = silhouette.table(phi);
        Self {
            prepare_ms: milliseconds::<B>(start),
            silhouette,
            table,
            vertices: scene.vertices(),
            orbits: scene.orbits(),
            target: scene.target(),
        }
    }

    /// Number of pairs that one pass visits, and the share that it culls of those that the default tolerance keeps.
    pub(crate) fn pairs(&self, scene: &Scene) -> (usize, f64) {
        let rasterizer = Rasterizer { t_conorm: scene.t_conorm, ..Rasterizer::new(scene.size) };
        let usual = rasterizer.prepare(&scene.faces, scene.softness, &scene.phi::<B>());
        let [pairs, kept] = [&self.silhouette, &usual]
            .map(|of| of.pairs(project(self.vertices.clone(), self.orbits.clone()).tensor()));
        (pairs, kept.saturating_sub(pairs) as f64 / kept.max(1) as f64)
    }

    /// Knots of the profile, and the distances outside and inside, in NDC, beyond which it is constant.
    pub(crate) fn profile(&self) -> (usize, [f64; 2]) {
        let profile = self.silhouette.profile();
        (profile.knots(), profile.support())
    }

    /// Draws the scene once, and differentiates if it has a target.
    pub(crate) fn step(&self) -> Step {
        let values = |image: Tensor<B, 3>| image.to_data().iter().collect();
        let [orbits, table] = [&self.orbits, &self.table].map(Clone::clone);
        let start = Instant::now();
        let Some(target) = &self.target else {
            let image = self.coverage(self.vertices.clone(), orbits, table);
            let forward_ms = milliseconds::<B>(start);
            return Step::of_silhouettes(values(image), None, forward_ms, None);
        };
        let vertices = Tensor::<Autodiff<B>, 3>::from_inner(self.vertices.clone()).require_grad();
        let [orbits, table] = [orbits, table].map(Tensor::from_inner);
        let image = self.coverage(vertices.clone(), orbits, table);
        let forward_ms = milliseconds::<B>(start);

        let start = Instant::now();
        let loss = mse_loss(image.clone(), Tensor::from_inner(target.clone())).mean();
        let grad = vertices.grad(&loss.backward()).expect("the image depends on the vertices");
        let backward_ms = Some(milliseconds::<B>(start));
        let norm = grad.to_data().iter::<f64>().map(|g| g * g).sum::<f64>().sqrt();
        let loss = Some([loss.into_scalar().elem(), norm]);
        Step::of_silhouettes(values(image.inner()), loss, forward_ms, backward_ms)
    }

    /// Coverage of world vertices.
    fn coverage<C: RasterBackend>(
        &self,
        vertices: Tensor<C, 3>,
        orbits: Tensor<C, 2>,
        table: Tensor<C, 2>,
    ) -> Tensor<C, 3> {
        self.silhouette.coverage_by_table(project(vertices, orbits).tensor(), table)
    }
}

/// Milliseconds since `start`, after the device has finished its work.
pub(crate) fn milliseconds<B: RasterBackend>(start: Instant) -> f64 {
    B::sync(&Default::default()).expect("the device finishes its work");
    start.elapsed().as_secs_f64() * 1e3
}
