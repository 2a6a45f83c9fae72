use std::sync::Arc;

use softrast_raster::{ImageSize, Projected, RasterBackend, hard_silhouette};
use softrast_tensor::{Tensor, tensor};

use crate::{Targets, triangles::Instance};

/// Weight of the Laplacian in the loss.
///
/// Source: docs/notes.md, 2D shape: 0.03, on coordinates that the camera multiplies by 2.155.
const LAPLACIAN: f64 = 0.03 / (2.155 * 2.155);
/// Distance of a corner from the middle of the other two, relative to that from the centroid.
const FROM_CENTROID: f64 = 1.5;

/// Loose triangles, and the picture that they should cover.
///
/// The optimised θ is flat, `[6 triangles]`: x and y of every corner in NDC. There is no camera,
/// and corners move freely, unlike in the released code, whose log-odds keep each coordinate on its
/// side of the centre.
///
/// ```
/// use softrast_inverse::triangles::{Instance, Scene};
/// use softrast_raster::HostBackend;
/// use softrast_tensor::numbers;
///
/// // A white picture.
/// let scene = Scene::<HostBackend>::new(&[1.0; 64], &Instance::seeded(0, 4, 8), 8);
/// let hard = scene.hard(scene.vertices(scene.start()));
/// let covered = numbers(hard.clone().mean())[0];
/// assert!((numbers(scene.image_loss(hard))[0] - (1.0 - covered)).abs() < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct Scene<B: RasterBackend> {
    start: Tensor<B, 1>,
    targets: Targets<B>,
    faces: Arc<[[u32; 3]]>,
    size: ImageSize,
}

impl<B: RasterBackend> Scene<B> {
    /// The triangles of `instance` and the picture `target` `[height * width]`, top row first, in
    /// [0, 1].
    ///
    /// # Panics
    ///
    /// If the picture does not have this size.
    pub fn new(target: &[f64], instance: &Instance, size: impl Into<ImageSize>) -> Self {
        let size = size.into();
        let corners = &instance.corners;
        let faces = (0..corners.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]);
        Self {
            start: tensor(corners.concat(), [2 * corners.len()]),
            targets: Targets::new(tensor(target.to_vec(), [1, size.height, size.width])),
            faces: faces.collect(),
            size,
        }
    }

    /// θ before the first step.
    pub fn start(&self) -> Tensor<B, 1> {
        self.start.clone()
    }

    /// The target picture, `[1, height, width]`.
    pub fn target(&self) -> Tensor<B, 3> {
        self.targets.full()
    }

    /// The corners at θ, `[1, corners, 3]`, at depth 1.
    pub fn vertices(&self, theta: Tensor<B, 1>) -> Projected<B> {
        let count = 3 * self.faces.len();
        let depth = tensor(vec![1.0; count], [1, count, 1]);
        Projected::new(Tensor::cat(vec![theta.reshape([1, count, 2]), depth], 2))
    }

    /// Hard silhouette `[1, height, width]` of corners from [`Scene::vertices`].
    pub fn hard(&self, vertices: Projected<B>) -> Tensor<B, 3> {
        hard_silhouette(vertices, &self.faces, self.size)
    }

    /// Mean squared difference of `image` `[1, height, width]` and the picture, `[1]`; the size is
    /// that of the scene, possibly halved some times.
    pub fn image_loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        self.targets.mse_loss(image)
    }

    /// The picture at every size that a run may draw at.
    pub fn targets(&self) -> &Targets<B> {
        &self.targets
    }

    /// Regularizer of the triangles' sizes: the weighted Laplacian loss of each triangle, `[1]`.
    ///
    /// `Σ |corner - middle of the other two|²` over all corners, times 0.0065. Source: docs/notes.md, 2D shape.
    pub fn smoothness_loss(&self, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        let corners = theta.reshape([self.faces.len(), 3, 2]);
        let centroids = corners.clone().sum_dim(1) * (1.0 / 3.0);
        let away = corners - centroids;
        (away.clone() * away).sum() * (LAPLACIAN * FROM_CENTROID * FROM_CENTROID)
    }
}
