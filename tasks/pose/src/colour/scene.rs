use softrast_inverse::{
    PoseProblem, SoftnessAt,
    pose::{ColouredViews, PoseInstance, PoseScene, VertexColours, split_coverage},
};
use softrast_raster::{Orbit, Projected, RasterBackend, project, vertex_tensor};
use softrast_softness::Softness;
use softrast_tensor::Tensor;

/// Instances of POSE by colour that are solved together, one view each.
///
/// θ is that of [`PoseScene`], images are those of [`ColouredViews`].
#[derive(Debug)]
pub struct Scene<B: RasterBackend> {
    silhouettes: PoseScene<B>,
    colours: ColouredViews<B>,
}

impl<B: RasterBackend> Scene<B> {
    /// Instances of a problem, the vertices of whose mesh have these `colours`, on images of `size` × `size` pixels; see [`PoseScene::new`].
    ///
    /// # Panics
    ///
    /// If there is no instance, or a vertex has no colour.
    pub fn new(
        problem: &PoseProblem,
        colours: &[[f64; 3]],
        instances: &[PoseInstance],
        size: usize,
    ) -> Self {
        let mesh = &problem.mesh;
        let silhouettes = PoseScene::new(problem, instances, size);
        let coat = VertexColours::new(colours, mesh.faces().into());
        let device = Default::default();
        let cameras: Vec<Orbit> = instances.iter().map(|instance| instance.target).collect();
        let world = vertex_tensor::<B>(mesh.positions(), &device);
        let target = coat.hard(project(world, Orbit::tensors(&cameras, &device)), size);
        let colours = ColouredViews::new(coat, target, silhouettes.target());
        Self { silhouettes, colours }
    }

    /// The scene without colours.
    pub fn silhouettes(&self) -> &PoseScene<B> {
        &self.silhouettes
    }

    /// The target hard image, `[views, 4, size, size]`.
    pub fn target(&self) -> Tensor<B, 4> {
        self.colours.target(self.silhouettes.target())
    }

    /// The soft image at θ under the softness of a step, `[views, 4, side, side]`.
    pub fn image(
        &self,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        self.image_with(theta, |seen| softness.silhouette(seen))
    }

    /// The soft image `[views, 4, side, side]` with another renderer of silhouettes
    /// `[views, side, side]`, given vertices `[views, vertices, 3]`.
    pub fn image_with(
        &self,
        theta: Tensor<B, 1>,
        silhouette: impl Fn(Projected<B>) -> Tensor<B, 3>,
    ) -> Tensor<B, 4> {
        let theta = self.silhouettes.by_view(theta);
        let distance = theta.clone().narrow(1, 0, 1);
        let seen = self.silhouettes.project(theta);
        let coverage = silhouette(seen.clone());
        self.colours.image(seen, distance, coverage)
    }

    /// The hard image at θ, `[views, 4, size, size]`. It has no gradient.
    pub fn hard(&self, theta: Tensor<B, 1>) -> Tensor<B, 4> {
        let seen = self.silhouettes.project(self.silhouettes.by_view(theta));
        self.colours.hard_image(seen.clone(), self.silhouettes.hard(seen))
    }

    /// The loss `[views]` of an image `[views, 4, side, side]`: the `IoU` loss of its silhouette plus [`ColouredViews::loss`].
    pub fn image_loss(&self, image: Tensor<B, 4>) -> Tensor<B, 1> {
        let (colours, coverage) = split_coverage(image);
        self.silhouettes.image_loss(coverage) + self.colours.loss(colours)
    }
}
