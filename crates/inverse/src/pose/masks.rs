use std::sync::Arc;

use anyhow::Context;
use softrast_mesh::{
    Mesh,
    vectors::{cross, dot, norm},
};
use softrast_raster::{
    HostBackend, Pinhole, Pinholes, Projected, RasterBackend, hard_silhouette, project,
    rotate_by_tangent, vertex_tensor,
};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers, tensor};

use super::{ColouredViews, VertexColours, split_coverage};
use crate::{InverseProblem, SoftnessAt, SolveConfig, Targets};
use softrast_views::{Frame, PaintedView, Picture};

/// Least distance of a camera from the middle of a mesh, as a multiple of that of the farthest vertex.
const CLEARANCE: f64 = 1.05;
/// Largest change of the logarithm of a distance or a focal length.
const FARTHEST: f64 = 3.0;

/// A mask, its compared square, and a start camera.
///
/// See [`MaskPoses`] for an example.
#[derive(Clone, Debug)]
pub struct MaskPose {
    /// The picture.
    pub mask: Picture,
    /// Left, top and extent of the compared square, in pixels.
    pub square: [f64; 3],
    /// The start camera, for the whole picture.
    pub start: Pinhole,
    /// The colours of the same picture, for poses by colour.
    pub painted: Option<PaintedView>,
}

/// Finds the camera pose at which a mesh has the silhouette of a mask.
///
/// θ holds, for each instance and relative to the start: a rotation of the camera as a tangent vector in radians, the apparent position of
/// the middle of the mesh (x and y, in radii of the mesh), and the logarithm of its depth; with an optimised focal length also its
/// logarithm. The loss is the soft `IoU` loss over the compared square; pixels outside the picture do not count. If the mesh and all
/// instances have colours, images are those of [`ColouredViews`], and its loss is added.
///
/// Mesh and cameras may be anywhere, in any unit: images are computed in the [`Frame`] of the mesh.
///
/// Cameras nearer to the middle of the mesh than 1.05 times its farthest vertex are not supported: depths stay beyond that, so that no
/// vertex is behind the camera.
///
/// ```
/// use softrast_inverse::pose::{MaskPose, MaskPoses, MaskScene};
/// use softrast_inverse::{Method, ScheduledSoftness, SolveConfig, minimize};
/// use softrast_mesh::fox;
/// use softrast_raster::{HostBackend, Pinhole};
/// use softrast_softness::{EdgeSoftness, Family};
/// use softrast_views::{Picture, coloured_pixels};
///
/// let [seen_from, start] = [[0.0, 0.5, 4.0], [0.5, 0.5, 4.0]]
///     .map(|eye| Pinhole::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], 40.0, 32));
/// let [.., covered] = coloured_pixels(&fox(), &seen_from);
/// let mask = Picture::new(covered.iter().map(|&part| part as f32).collect(), 32);
/// let pose = MaskPose { square: mask.view_square()?, mask, start, painted: None };
/// let problem = MaskPoses::new(&fox(), vec![pose.clone()]);
/// let method = Method::new("gauss", ScheduledSoftness::constant(EdgeSoftness::new(Family::Gauss), 0.05));
/// let (config, mut off) = (SolveConfig { size: 16, steps: 15, learning_rate: 0.03 }, Vec::new());
/// let poses = [pose];
/// minimize::<_, HostBackend>(&problem, &poses, &method, &config, |iterate, scene: &MaskScene<HostBackend>| {
///     let [camera] = scene.found(iterate.theta.clone(), &poses)[..] else { unreachable!() };
///     off.push(camera.eye()[0].abs());
///     Ok(())
/// })?;
/// assert!(off[15] < 0.5 * off[0], "{off:?}");
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Debug)]
pub struct MaskPoses {
    /// The mesh in its frame.
    mesh: Mesh,
    frame: Frame,
    /// Whether the field of view is optimised too, from that of the start.
    pub optimise_fov: bool,
    instances: Vec<MaskPose>,
}

impl MaskPoses {
    /// Poses of a mesh; entry `k` is the instance of seed `k`.
    pub fn new(mesh: &Mesh, instances: Vec<MaskPose>) -> Self {
        let frame = Frame::of_mesh(mesh);
        Self { mesh: frame.mesh(mesh), frame, optimise_fov: false, instances }
    }
}

impl InverseProblem for MaskPoses {
    type Instance = MaskPose;
    type Scene<B: RasterBackend> = MaskScene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<MaskPose> {
        let instance = usize::try_from(seed).ok().and_then(|k| self.instances.get(k));
        instance.cloned().with_context(|| format!("there are {} poses", self.instances.len()))
    }

    fn scene<B: RasterBackend>(&self, instances: &[MaskPose], size: usize) -> MaskScene<B> {
        MaskScene::new(self, instances, size)
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        Some(self.mesh.faces().into())
    }

    fn start<B: RasterBackend>(&self, scene: &MaskScene<B>) -> Tensor<B, 1> {
        let [views, numbers] = scene.shape();
        tensor(vec![0.0; views * numbers], [views * numbers])
    }

    fn allowed<B: RasterBackend>(&self, scene: &MaskScene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.allowed(theta)
    }

    fn image<B: RasterBackend>(
        &self,
        scene: &MaskScene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        let seen = scene.project(theta.clone());
        let coverage = softness.silhouette(seen.clone());
        match &scene.colours {
            Some(colours) => colours.image(seen, scene.depth(theta), coverage),
            None => coverage.unsqueeze_dim(1),
        }
    }

    fn hard_image<B: RasterBackend>(
        &self,
        scene: &MaskScene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 4> {
        let seen = scene.project(theta);
        let coverage = hard_silhouette(seen.clone(), &scene.faces, scene.cameras.size);
        match &scene.colours {
            Some(colours) => colours.hard_image(seen, coverage),
            None => coverage.unsqueeze_dim(1),
        }
    }

    fn image_loss<B: RasterBackend>(
        &self,
        scene: &MaskScene<B>,
        image: Tensor<B, 4>,
    ) -> Tensor<B, 1> {
        match &scene.colours {
            Some(views) => {
                let (colours, coverage) = split_coverage(image);
                scene.targets.iou_loss(coverage) + views.loss(colours)
            }
            None => scene.targets.iou_loss(image.squeeze_dim(1)),
        }
    }

    fn loss_at<B: RasterBackend>(
        &self,
        scene: &MaskScene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        match &scene.colours {
            Some(_) => self.image_loss(scene, self.image(scene, theta, softness)),
            None => softness.iou_loss(scene.project(theta), &scene.targets),
        }
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 64, steps: 100, learning_rate: 0.03 }
    }
}

/// Instances of [`MaskPoses`] that are solved together, one view each.
#[derive(Debug)]
pub struct MaskScene<B: RasterBackend> {
    vertices: Tensor<B, 3>,
    faces: Arc<[[u32; 3]]>,
    /// Start cameras, for the compared squares.
    cameras: Pinholes<B>,
    /// Apparent position of the middle of the mesh at the start, `[views, 2]`, as x and y at depth
    /// 1; its depth `[views, 1]`; the radius of the mesh at that depth.
    seen: Tensor<B, 2>,
    depth: Tensor<B, 2>,
    radius: Tensor<B, 2>,
    frame: Frame,
    /// Least logarithm of the depth relative to the start, `[views, 1]`.
    nearest: Tensor<B, 2>,
    optimise_fov: bool,
    targets: Targets<B>,
    colours: Option<ColouredViews<B>>,
}

impl<B: RasterBackend> MaskScene<B> {
    fn new(problem: &MaskPoses, instances: &[MaskPose], size: usize) -> Self {
        let (views, device) = (instances.len(), Default::default());
        let MaskPoses { mesh, frame, optimise_fov, .. } = problem;
        let cropped = |of: &MaskPose| {
            let [left, top, extent] = of.square;
            frame.camera(&of.start).cropped([left, top], [extent; 2], size)
        };
        let cameras: Vec<Pinhole> = instances.iter().map(cropped).collect();
        // The middle of the mesh is the origin of the frame, and its radius is 1.
        let seen: Vec<[f64; 3]> = cameras.iter().map(|camera| camera.translation).collect();
        let column = |of: &dyn Fn(&[f64; 3]) -> f64| {
            tensor::<B, 2>(seen.iter().map(of).collect(), [views, 1])
        };
        let at = seen.iter().flat_map(|[x, y, z]| [x / z, y / z]);
        let nearest =
            |&[_, _, z]: &[f64; 3]| (CLEARANCE / z).ln().clamp(-FARTHEST, FARTHEST).min(0.0);
        let painted = instances.iter().map(|of| Some((of.painted.as_ref()?, of.square)));
        let painted: Option<Vec<_>> = painted.collect();
        let colours = mesh.colours().zip(painted).map(|(colours, painted)| {
            let coat = VertexColours::new(colours, mesh.faces().into());
            ColouredViews::of_pictures(coat, &painted, size)
        });
        Self {
            vertices: vertex_tensor(mesh.positions(), &device),
            faces: mesh.faces().into(),
            cameras: Pinholes::new(&cameras, &device),
            seen: tensor(at.collect(), [views, 2]),
            depth: column(&|p| p[2]),
            radius: column(&|p| 1.0 / p[2]),
            frame: *frame,
            nearest: column(&nearest),
            optimise_fov: *optimise_fov,
            targets: Targets::of_masks(instances.iter().map(|of| (&of.mask, of.square)), size),
            colours,
        }
    }

    /// The weighted difference of an image `[views, size, size]` and the mask, on `side` × `side` pixels: `[views, side, side]`.
    pub(super) fn differences(&self, image: Tensor<B, 3>, side: usize) -> Tensor<B, 3> {
        self.targets.differences(image, side)
    }

    /// Number of views, and of parameters per view.
    fn shape(&self) -> [usize; 2] {
        [self.depth.dims()[0], if self.optimise_fov { 7 } else { 6 }]
    }

    /// Depth of the middle of the mesh at θ, `[views, 1]`.
    fn depth(&self, theta: Tensor<B, 1>) -> Tensor<B, 2> {
        let theta = theta.reshape(self.shape());
        let farther = theta.clone().narrow(1, 5, 1);
        // A longer lens is moved away, to keep the apparent size.
        let farther = if self.optimise_fov { farther + theta.narrow(1, 6, 1) } else { farther };
        self.depth.clone() * farther.exp()
    }

    /// Cameras at θ, for the compared squares.
    fn cameras(&self, theta: Tensor<B, 1>) -> Pinholes<B> {
        let depth = self.depth(theta.clone());
        let theta = theta.reshape(self.shape());
        let part = |start: usize, length: usize| theta.clone().narrow(1, start, length);
        let zoom = self.optimise_fov.then(|| part(6, 1));
        let beside = (self.seen.clone() + part(3, 2) * self.radius.clone()) * depth.clone();
        let Pinholes { rotation, intrinsics, size, .. } = self.cameras.clone();
        let rotation = rotate_by_tangent(part(0, 3), rotation);
        let translation = Tensor::cat(vec![beside, depth], 1);
        let intrinsics = match zoom {
            None => intrinsics,
            Some(zoom) => {
                let focal = intrinsics.clone().narrow(1, 0, 2) * zoom.exp();
                Tensor::cat(vec![focal, intrinsics.narrow(1, 2, 2)], 1)
            }
        };
        Pinholes { rotation, translation, intrinsics, size }
    }

    fn project(&self, theta: Tensor<B, 1>) -> Projected<B> {
        project(self.vertices.clone(), self.cameras(theta))
    }

    /// Keeps the mesh in front of the camera, and depth and focal length bounded.
    fn allowed(&self, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        let theta = theta.reshape(self.shape());
        let zoom =
            self.optimise_fov.then(|| theta.clone().narrow(1, 6, 1).clamp(-FARTHEST, FARTHEST));
        // A longer lens has been moved away already.
        let farther = zoom.clone().unwrap_or_else(|| self.nearest.zeros_like());
        let depth = theta.clone().narrow(1, 5, 1);
        let depth = (depth + farther.clone()).max_pair(self.nearest.clone()).clamp_max(FARTHEST);
        let columns = [Some(theta.narrow(1, 0, 5)), Some(depth - farther), zoom];
        Tensor::cat(columns.into_iter().flatten().collect(), 1).flatten(0, 1)
    }
}

impl MaskScene<HostBackend> {
    /// The cameras at θ for the whole pictures of these instances.
    pub fn found(&self, theta: Tensor<HostBackend, 1>, instances: &[MaskPose]) -> Vec<Pinhole> {
        let Pinholes { rotation, translation, intrinsics, .. } = self.cameras(theta);
        let (r, t, k) = (numbers(rotation), numbers(translation), numbers(intrinsics));
        let camera = |(view, of): (usize, &MaskPose)| {
            let r = &r[9 * view..9 * view + 9];
            let side = self.cameras.size.width as f64;
            let gain = side / of.square[2];
            self.frame.camera_to_world(&Pinhole {
                rotation: orthonormal([0, 1, 2].map(|i| [r[3 * i], r[3 * i + 1], r[3 * i + 2]])),
                translation: [0, 1, 2].map(|i| t[3 * view + i]),
                focal: match self.optimise_fov {
                    true => [0, 1].map(|i| k[4 * view + i] / gain),
                    false => of.start.focal,
                },
                ..of.start
            })
        };
        instances.iter().enumerate().map(camera).collect()
    }
}

/// A rotation, orthonormalized against rounding in f32.
fn orthonormal([x, y, _]: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let unit = |a: [f64; 3]| a.map(|value| value / norm(a));
    let x = unit(x);
    let along = dot(x, y);
    let y = unit([0, 1, 2].map(|k| y[k] - along * x[k]));
    [x, y, cross(x, y)]
}
