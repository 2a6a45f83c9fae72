use std::sync::Arc;

use softrast_mesh::{Mesh, vectors::norm};
use softrast_raster::{
    HostBackend, Orbit, Projected, RasterBackend, hard_silhouette, project, vertex_tensor,
    view_rotation,
};
use softrast_tensor::{Tensor, numbers, tensor};

use super::{PoseInstance, PoseProblem};
use crate::Targets;

/// Least distance of a camera from the origin, as a multiple of that of the farthest vertex.
const CLEARANCE: f64 = 1.05;
/// Bounds of half the field of view, in degrees.
const HALF_FOV_DEG: [f64; 2] = [1.0, 80.0];

/// Instances of POSE that are solved together, one view each.
///
/// The optimised θ is `[views, 3]`: distance in world units, elevation and azimuth in degrees; with
/// an optimised field of view `[views, 4]`, the last being half of it in degrees.
///
/// ```
/// use softrast_inverse::{InverseProblem, PoseProblem, pose::{PoseInstance, PoseScene}};
/// use softrast_mesh::fox;
/// use softrast_raster::HostBackend;
/// use softrast_tensor::{numbers, tensor};
///
/// let problem = PoseProblem::new(&fox());
/// let instance: PoseInstance = problem.instance(0)?;
/// let scene = PoseScene::<HostBackend>::new(&problem, &[instance], 16);
/// let loss = |theta| numbers(scene.image_loss(scene.hard(scene.project(theta))))[0];
/// // Elevation and azimuth are 0 at the answer.
/// let answer = tensor(vec![instance.target.distance, 0.0, 0.0], [1, 3]);
/// assert!(loss(answer) < 0.1 && loss(scene.start()) > 0.1);
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Debug)]
pub struct PoseScene<B: RasterBackend> {
    /// The mesh along the axes of each target camera, rotated but not translated: `[views, vertices, 3]`.
    turned: Tensor<B, 3>,
    /// Field of view of each view in degrees, `[views, 1]`, unless θ holds half of it.
    fov: Option<Tensor<B, 2>>,
    start: Tensor<B, 2>,
    /// Nearest distance of each view, `[views, 1]`.
    nearest: Tensor<B, 2>,
    faces: Arc<[[u32; 3]]>,
    targets: Targets<B>,
    size: usize,
}

impl<B: RasterBackend> PoseScene<B> {
    /// Instances of a problem on images of `size` × `size` pixels.
    ///
    /// The field of view of each start is used unchanged, unless the problem optimises it.
    ///
    /// # Panics
    ///
    /// If there is no instance.
    pub fn new(problem: &PoseProblem, instances: &[PoseInstance], size: usize) -> Self {
        let PoseProblem { mesh, optimise_fov, .. } = problem;
        let views = instances.len();
        assert!(views > 0, "a scene needs an instance");
        let orbits = |of: fn(&PoseInstance) -> Orbit| instances.iter().map(of).collect();
        let (ends, starts): (Vec<Orbit>, Vec<Orbit>) =
            (orbits(|of| of.target), orbits(|of| of.start));
        let [turned, target] = match B::ON_HOST {
            true => seen_by::<B>(mesh, &ends, size),
            // In a browser, data on a GPU cannot be read synchronously, and hard silhouettes are drawn on the CPU.
            false => seen_by::<HostBackend>(mesh, &ends, size).map(|seen| {
                let shape = seen.dims();
                tensor(numbers(seen), shape)
            }),
        };
        let device = Default::default();
        let targets = Orbit::tensors::<B>(&ends, &device);
        let starts = Orbit::tensors::<B>(&starts, &device);
        let [pose, fov] = [(0, 3), (3, 1)].map(|(start, n)| starts.clone().narrow(1, start, n));
        let (start, fov) = match *optimise_fov {
            true => (Tensor::cat(vec![pose, fov * 0.5], 1), None),
            false => (pose, Some(fov)),
        };
        let given = starts.narrow(1, 0, 1).min_pair(targets.narrow(1, 0, 1));
        let nearest = given.clamp_max(nearest_distance(mesh));
        let (faces, targets) = (mesh.faces().into(), Targets::new(target));
        Self { turned, fov, start, nearest, faces, targets, size }
    }

    /// θ before the first step.
    pub fn start(&self) -> Tensor<B, 2> {
        self.start.clone()
    }

    /// A flat θ as `[views, 3]` or `[views, 4]`.
    pub fn by_view(&self, theta: Tensor<B, 1>) -> Tensor<B, 2> {
        theta.reshape(self.start.dims())
    }

    /// Target hard silhouettes, `[views, size, size]`.
    pub fn target(&self) -> Tensor<B, 3> {
        self.targets.full()
    }

    /// The projected mesh at θ, `[views, vertices, 3]`.
    pub fn project(&self, theta: Tensor<B, 2>) -> Projected<B> {
        let fov = self.fov.clone().unwrap_or_else(|| theta.clone().narrow(1, 3, 1) * 2.0);
        project(self.turned.clone(), Tensor::cat(vec![theta.narrow(1, 0, 3), fov], 1))
    }

    /// Hard silhouettes `[views, size, size]` of vertices from [`PoseScene::project`].
    pub fn hard(&self, projected: Projected<B>) -> Tensor<B, 3> {
        hard_silhouette(projected, &self.faces, self.size)
    }

    /// `IoU` loss `[views]` of each `image` `[views, side, side]`; the side is the size of the
    /// scene, possibly halved some times.
    pub fn image_loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        self.targets.iou_loss(image)
    }

    /// The targets at every size that a run may draw at.
    pub fn targets(&self) -> &Targets<B> {
        &self.targets
    }

    /// Projects θ onto the allowed poses.
    ///
    /// The camera stays outside the ball around the origin that contains the mesh, with a margin of
    /// 5 %, so that the whole mesh is in front of it (a step of Adam can be 0.3 world units for any
    /// gradient); an instance that starts or ends nearer may approach that far. Half the field of
    /// view stays within 1 to 80 degrees. Not in the paper, whose released code lets the mesh pass
    /// through the camera (docs/notes.md, Faces behind the camera).
    pub fn allowed(&self, theta: Tensor<B, 2>) -> Tensor<B, 2> {
        let part = |start: usize, length: usize| theta.clone().narrow(1, start, length);
        let mut columns = vec![part(0, 1).max_pair(self.nearest.clone()), part(1, 2)];
        if self.fov.is_none() {
            let [least, largest] = HALF_FOV_DEG;
            columns.push(part(3, 1).clamp(least, largest));
        }
        Tensor::cat(columns, 1)
    }
}

/// The mesh along the axes of each camera `[views, vertices, 3]`, and its hard silhouettes `[views, size, size]`.
fn seen_by<B: RasterBackend>(mesh: &Mesh, cameras: &[Orbit], size: usize) -> [Tensor<B, 3>; 2] {
    let (views, count, device) = (cameras.len(), mesh.positions().len(), Default::default());
    let cameras = Orbit::tensors::<B>(cameras, &device);
    let positions = vertex_tensor::<B>(mesh.positions(), &device);
    let seen = project(positions.clone(), cameras.clone());
    let silhouettes = hard_silhouette(seen, mesh.faces(), size);
    let angle = |k: usize| cameras.clone().narrow(1, k, 1).reshape([views]);
    let rotation = view_rotation(angle(1), angle(2));
    let turned = positions.expand([views, count, 3]).matmul(rotation.swap_dims(1, 2));
    [turned, silhouettes]
}

/// Distance from the origin beyond which the whole mesh is in front of a camera.
pub fn nearest_distance(mesh: &Mesh) -> f64 {
    CLEARANCE * mesh.triangles().flatten().map(norm).fold(0.0, f64::max)
}
