use burn::tensor::Tensor;
use softrast_inverse::{
    SoftnessAt, Targets,
    pose::{PoseInstance, PoseScene},
};
use softrast_mesh::Mesh;
use softrast_raster::{Orbit, RasterBackend, mse_loss, project, vertices};

use super::Coat;

/// Weight of the error of colours beside the `IoU` loss. With 5, 10 and 20, colours found 25, 24 and 24 of 28 poses that silhouettes did not
/// (docs/notes.md, Pose by colour).
const COLOURS: f64 = 5.0;
/// Colours are compared on pictures of so many pixels a side: on more, only what nearly fits pulls.
const SIDES: std::ops::RangeInclusive<usize> = 4..=8;

/// Instances of POSE by colour that are solved together, one view each.
///
/// θ is that of [`PoseScene`]. An image `[4 views, side, side]` has of each view red, green and blue over black, from 0 to 1, then the
/// coverage: the soft silhouette. Colours are hardly softened, but multiplied by it.
#[derive(Debug)]
pub struct Scene<B: RasterBackend> {
    silhouettes: PoseScene<B>,
    coat: Coat<B>,
    /// Red, green and blue over black, `[3 views, size, size]`, and halves of halves of it.
    colours: Targets<B>,
    /// The part of each picture that the mesh covers, `[views]`, or a pixel of it.
    covered: Tensor<B, 1>,
    size: usize,
}

impl<B: RasterBackend> Scene<B> {
    /// Instances of a mesh whose vertices have these `colours`, on images of `size` × `size` pixels; see [`PoseScene::new`].
    ///
    /// # Panics
    ///
    /// If there is no instance, or a vertex has no colour.
    pub fn new(
        mesh: &Mesh,
        colours: &[[f64; 3]],
        instances: &[PoseInstance],
        size: usize,
        optimise_fov: bool,
    ) -> Self {
        let silhouettes = PoseScene::new(mesh, instances, size, optimise_fov);
        let coat = Coat::new(colours, mesh.faces().into());
        let (views, device) = (instances.len(), Default::default());
        let cameras: Vec<Orbit> = instances.iter().map(|instance| instance.target).collect();
        let world = vertices::<B>(mesh.positions(), &device);
        let target = coat.hard(project(world, Orbit::tensors(&cameras, &device)), size);
        let covered: Tensor<B, 2> = silhouettes.target().flatten(1, 2);
        let covered =
            covered.mean_dim(1).reshape([views]).clamp_min(((size * size) as f64).recip());
        let colours = Targets::new(target.reshape([3 * views, size, size]));
        Self { silhouettes, coat, colours, covered, size }
    }

    /// What is the same without colours.
    pub fn silhouettes(&self) -> &PoseScene<B> {
        &self.silhouettes
    }

    /// The hard image to arrive at, `[4 views, size, size]`.
    pub fn target(&self) -> Tensor<B, 3> {
        let coverage = self.silhouettes.target();
        let [views, size, _] = coverage.dims();
        joined(self.colours.full().reshape([views, 3, size, size]), coverage)
    }

    /// The soft image at θ under the softness of a step, `[4 views, side, side]`.
    pub fn image(&self, theta: Tensor<B, 1>, softness: &SoftnessAt<'_, B>) -> Tensor<B, 3> {
        self.image_with(theta, |seen| softness.silhouette(seen))
    }

    /// The same with what draws silhouettes `[views, side, side]` of vertices `[views, vertices, 3]`.
    pub fn image_with(
        &self,
        theta: Tensor<B, 1>,
        silhouette: impl Fn(Tensor<B, 3>) -> Tensor<B, 3>,
    ) -> Tensor<B, 3> {
        let theta = self.silhouettes.by_view(theta);
        let distance = theta.clone().narrow(1, 0, 1);
        let seen = self.silhouettes.project(theta);
        let coverage = silhouette(seen.clone());
        let colours = self.coat.soft(seen, distance, coverage.dims()[1]);
        let shape = colours.dims();
        joined(colours * coverage.clone().unsqueeze_dim::<4>(1).expand(shape), coverage)
    }

    /// The hard image at θ, `[4 views, size, size]`. It has no gradient.
    pub fn hard(&self, theta: Tensor<B, 1>) -> Tensor<B, 3> {
        let seen = self.silhouettes.project(self.silhouettes.by_view(theta));
        joined(self.coat.hard(seen.clone(), self.size), self.silhouettes.hard(seen))
    }

    /// What is wrong with an image `[4 views, side, side]`, `[views]`: the `IoU` loss of its silhouette, and 5 times the error of its
    /// colours. The side is the size of the scene, or that halved some times.
    ///
    /// The error of colours is their mean squared difference over black, divided by the part of the target picture that the mesh covers, so
    /// that it does not depend on how large the mesh is seen: the mean of it on pictures of 8 and 4 pixels a side, or whatever halves of
    /// halves of the side there are from 4 to 8. Where there is none, it is that of the fewest pixels that halving leads to.
    pub fn image_loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        let [planes, side, _] = image.dims();
        let views = planes / 4;
        let image = image.reshape([views, 4, side, side]);
        let coverage = image.clone().narrow(1, 3, 1).reshape([views, side, side]);
        let colours = Targets::new(image.narrow(1, 0, 3).reshape([3 * views, side, side]));
        let mut errors = Vec::new();
        let fewest = colours.levels().last().map_or(side, |level| level.dims()[1]);
        for level in colours.levels() {
            let [_, side, _] = level.dims();
            if SIDES.contains(&side) || (errors.is_empty() && side == fewest) {
                let both = [level.clone(), self.colours.of(level)];
                let [found, wanted] = both.map(|of| of.reshape([views, 3, side, side]));
                errors.push(mse_loss(found, wanted));
            }
        }
        let count = errors.len() as f64;
        let error =
            Tensor::stack::<2>(errors, 0).sum_dim(0).reshape([views]) / self.covered.clone();
        self.silhouettes.image_loss(coverage) + error * (COLOURS / count)
    }
}

/// Colours `[views, 3, side, side]` and coverage `[views, side, side]` as an image.
fn joined<B: RasterBackend>(colours: Tensor<B, 4>, coverage: Tensor<B, 3>) -> Tensor<B, 3> {
    let [views, side, _] = coverage.dims();
    Tensor::cat(vec![colours, coverage.unsqueeze_dim(1)], 1).reshape([4 * views, side, side])
}
