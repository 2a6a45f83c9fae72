use std::sync::Arc;

use softrast_inverse::{Surface, Targets};
use softrast_mesh::{Edges, Mesh};
use softrast_raster::{Projected, RasterBackend, hard_silhouette, project};
use softrast_tensor::{Tensor, tensor};

use crate::Instance;

/// Number of cameras around the target, evenly in azimuth.
pub const VIEWS: usize = 24;
/// Distance of the cameras in world units, and their field of view in degrees.
///
/// Source: docs/notes.md, 3D shape.
pub(crate) const DISTANCE: f64 = 2.732;
const FOV_DEG: f64 = 30.0;

/// Weights of the bending of the surface in the loss: Laplacian and flatness. Source: docs/notes.md, 3D shape.
const LAPLACIAN: f64 = 0.03;
const FLATNESS: f64 = 0.0003;

/// A coordinate this near to a plane through the origin, in world units, remains in that plane: its
/// log-odds would be close to minus infinity.
const ON_PLANE: f64 = 1e-6;

/// A deformable template and its target silhouettes.
///
/// The optimised θ is flat, `[3 vertices + 3]`: a displacement `d` of each coordinate, then the centre `k`. A
/// coordinate that starts at `v` is at `s·σ(logit|v| + d)·(1 - s·c) + c` with `s` the sign of `v` and `c = tanh k`, all
/// within -1 to 1. Therefore no vertex crosses the planes through the centre, and a coordinate that starts at 0 stays
/// at that of the centre. Source: docs/notes.md, 3D shape.
#[derive(Clone, Debug)]
pub struct Scene<B: RasterBackend> {
    /// `logit |v|` of each coordinate, `[vertices, 3]`; 0 if the sign is 0.
    log_odds: Tensor<B, 2>,
    /// -1, 0 or 1, `[vertices, 3]`.
    sign: Tensor<B, 2>,
    orbits: Tensor<B, 2>,
    faces: Arc<[[u32; 3]]>,
    surface: Surface<B>,
    targets: Targets<B>,
    size: usize,
}

impl<B: RasterBackend> Scene<B> {
    /// The `instance` with these meshes on images of `size` × `size` pixels.
    pub fn new(target: &Mesh, template: &Mesh, instance: &Instance, size: usize) -> Self {
        let azimuths_deg = (0..VIEWS).map(|view| 360.0 / VIEWS as f64 * view as f64);
        let orbit = |azimuth| [DISTANCE, instance.elevation_deg, azimuth, FOV_DEG];
        let orbits = tensor(azimuths_deg.flat_map(orbit).collect(), [VIEWS, 4]);
        let count = target.positions().len();
        let positions: Tensor<B, 3> = tensor(target.positions().concat(), [1, count, 3]);
        let target =
            hard_silhouette(project(positions, Tensor::clone(&orbits)), target.faces(), size);

        let start = instance.start(template).concat();
        let count = template.positions().len();
        let on_plane = |v: f64| v.abs() < ON_PLANE;
        let log_odds = |&v: &f64| if on_plane(v) { 0.0 } else { (v.abs() / (1.0 - v.abs())).ln() };
        let sign = |&v: &f64| if on_plane(v) { 0.0 } else { v.signum() };
        let edges = Edges::new(template.faces());
        Self {
            log_odds: tensor(start.iter().map(log_odds).collect(), [count, 3]),
            sign: tensor(start.iter().map(sign).collect(), [count, 3]),
            orbits,
            surface: Surface::of_edges(&edges, count, &Default::default()),
            faces: template.faces().into(),
            targets: Targets::new(target),
            size,
        }
    }

    /// θ before the first step: zeros.
    pub fn start(&self) -> Tensor<B, 1> {
        let [vertices, _] = self.sign.dims();
        tensor(vec![0.0; 3 * vertices + 3], [3 * vertices + 3])
    }

    /// Target hard silhouettes, `[views, size, size]`.
    pub fn target(&self) -> Tensor<B, 3> {
        self.targets.full()
    }

    /// The vertices at θ, `[vertices, 3]` in world units.
    pub fn vertices(&self, theta: Tensor<B, 1>) -> Tensor<B, 2> {
        let [vertices, _] = self.sign.dims();
        let displacement = theta.clone().narrow(0, 0, 3 * vertices).reshape([vertices, 3]);
        let centre = theta.narrow(0, 3 * vertices, 3).tanh().reshape([1, 3]);
        let size = ((displacement + self.log_odds.clone()) * 0.5).tanh() * 0.5 + 0.5;
        let sign = self.sign.clone();
        let away = sign.clone() - sign.clone() * sign * centre.clone();
        size * away + centre
    }

    /// Vertices `[vertices, 3]` projected by each camera, `[views, vertices, 3]`.
    pub fn project(&self, vertices: Tensor<B, 2>) -> Projected<B> {
        project(vertices.unsqueeze(), self.orbits.clone())
    }

    /// Hard silhouettes `[views, size, size]` of vertices from [`Scene::project`].
    pub fn hard(&self, projected: Projected<B>) -> Tensor<B, 3> {
        hard_silhouette(projected, &self.faces, self.size)
    }

    /// `IoU` loss of `image` `[views, side, side]`, mean over the views, `[1]`; the side is the
    /// size of the scene, possibly halved some times.
    pub fn image_loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        self.targets.iou_loss(image).mean()
    }

    /// The targets at every size that a run may draw at.
    pub fn targets(&self) -> &Targets<B> {
        &self.targets
    }

    /// The smoothness loss `[1]` of `vertices` `[vertices, 3]`: 0.03 times the Laplacian loss and
    /// 0.0003 times the flatness loss. Second derivatives are finite everywhere.
    pub fn smoothness_loss(&self, vertices: Tensor<B, 2>) -> Tensor<B, 1> {
        let vertices: Tensor<B, 3> = vertices.unsqueeze();
        let laplacian = self.surface.laplacian(vertices.clone());
        laplacian * LAPLACIAN + self.surface.flatness(vertices) * FLATNESS
    }
}
