//! Workloads W1 and W2 of DESIGN 5, whose exact results are known.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use burn::{
    backend::Autodiff,
    tensor::{Element, Tensor, TensorData, backend::Backend},
};
use softrast_mesh::Mesh;
use softrast_raster::{RasterBackend, Rasterizer, TConorm, mse_loss, project, reference};
use softrast_softness::{EdgeSoftness, Family, Softness};

/// The logistic of the signed squared distance.
const SOFTNESS: EdgeSoftness = EdgeSoftness { family: Family::Logistic, squared: true };
/// Its scale in NDC².
const SCALE: f64 = 1e-4;
/// Distance (world units), elevation and half the field of view (degrees) of every camera.
const CAMERA: [f64; 3] = [2.732, 0.0, 30.0];
/// Centre and radius of the disk that images are compared with, in NDC.
const DISK: ([f64; 2], f64) = ([-0.1, 0.05], 0.5);

/// A mesh seen from several sides, compared with the image of a disk.
#[derive(Clone, Debug)]
pub struct Workload {
    /// What is drawn, in world units.
    pub mesh: Mesh,
    /// Azimuths of the cameras in degrees.
    pub azimuths_deg: Vec<f64>,
    /// Width and height of the image in pixels.
    pub size: usize,
}

/// What a workload comes to.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Mean squared difference to the disk over views and pixels.
    pub loss: f64,
    /// Mean coverage over views and pixels.
    pub mean_alpha: f64,
    /// Norm of the gradient of the loss to the vertices in world units, all views together.
    pub gradient_norm: f64,
}

impl Row {
    /// W1 in f64 with every pair evaluated. Source: DESIGN 5.
    pub const W1: Self =
        Self { loss: 0.170_335_7, mean_alpha: 0.368_661_6, gradient_norm: 0.035_785_6 };
    /// W2 in f64 with every pair evaluated. Source: DESIGN 5.
    pub const W2: Self =
        Self { loss: 0.110_763_3, mean_alpha: 0.153_004_8, gradient_norm: 0.056_845_9 };

    /// Relative differences from `exact`: loss, mean coverage, gradient norm.
    pub fn errors(&self, exact: &Self) -> [f64; 3] {
        let error = |found: f64, exact: f64| (found / exact - 1.0).abs();
        [
            error(self.loss, exact.loss),
            error(self.mean_alpha, exact.mean_alpha),
            error(self.gradient_norm, exact.gradient_norm),
        ]
    }

    /// Asserts that loss and mean coverage agree with `exact` to 1e-4, and the gradient norm to 1e-3.
    ///
    /// # Panics
    ///
    /// If they do not.
    pub fn assert_agrees(&self, exact: &Self) {
        let errors = self.errors(exact);
        println!("{self:?}: relative errors {errors:?}");
        let [loss, mean_alpha, gradient_norm] = errors;
        let close = loss <= 1e-4 && mean_alpha <= 1e-4 && gradient_norm <= 1e-3;
        assert!(close, "{self:?} is off by {errors:?} of {exact:?}");
    }
}

/// W1: the sphere of 1280 faces from 24 sides, 64 × 64; `None` where the mesh is missing.
///
/// It is not the [`icosphere`](softrast_mesh::icosphere) of as many faces: every face of its
/// icosahedron is cut into 64 at once, not into 4 three times, which moves the gradient by 2.6 %.
pub fn w1() -> Option<Workload> {
    let azimuths_deg = (0..24).map(|view| 15.0 * f64::from(view)).collect();
    Some(Workload { mesh: load("sphere_642.obj")?, azimuths_deg, size: 64 })
}

/// W2: the cow spot of 5856 faces from its front, 256 × 256; `None` where the mesh is missing.
pub fn w2() -> Option<Workload> {
    Some(Workload { mesh: load("spot.obj")?, azimuths_deg: vec![180.0], size: 256 })
}

/// A mesh of the paper, which is not part of the repository; prints that it was skipped where it is
/// missing.
pub fn paper_mesh(name: &str) -> Option<PathBuf> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/meshes/paper");
    let path = Path::new(folder).join(name);
    if !path.exists() {
        println!("skipped: there is no {}", path.display());
        return None;
    }
    Some(path)
}

fn load(name: &str) -> Option<Mesh> {
    Some(Mesh::load(paper_mesh(name)?).expect("the meshes of the paper are valid"))
}

impl Workload {
    /// The result by the fused op with this tolerance, in the float type of `B`.
    ///
    /// # Panics
    ///
    /// If nothing of the mesh can be seen.
    pub fn by_fused_op<B: RasterBackend>(&self, tolerance: f64) -> Row {
        let faces: Arc<[[u32; 3]]> = self.mesh.faces().into();
        let rasterizer = Rasterizer { tolerance, ..Rasterizer::new(self.size) };
        let phi = self.phi::<B>();
        let silhouette = rasterizer.prepare(&faces, SOFTNESS, &phi);
        let world = Tensor::<Autodiff<B>, 3>::from_inner(self.world()).require_grad();
        let alpha = silhouette.coverage(self.project(world.clone()), Tensor::from_inner(phi));
        let loss = self.loss(alpha.clone());
        let gradient = world.grad(&loss.backward()).expect("the loss depends on the vertices");
        row(loss.inner(), alpha.inner(), gradient)
    }

    /// The result by the reference: every pixel-face pair, chunk by chunk.
    ///
    /// # Panics
    ///
    /// If nothing of the mesh can be seen.
    pub fn by_reference<B: Backend>(&self) -> Row {
        let scene = reference::Scene { faces: self.mesh.faces(), size: self.size };
        let conorm = TConorm::default();
        let phi = self.phi::<B>();
        let world = Tensor::<Autodiff<B>, 3>::from_inner(self.world()).require_grad();
        let screen = self.project(world.clone());
        let plain = screen.clone().inner();
        let sums = reference::sums(scene, plain.clone(), &SOFTNESS, conorm, phi.clone());
        let sums = Tensor::<Autodiff<B>, 3>::from_inner(sums).require_grad();
        let alpha = conorm.coverage(sums.clone());
        let loss = self.loss(alpha.clone());
        let upstream = sums.grad(&loss.backward()).expect("the loss depends on the sums");
        let gradient = reference::vjp(scene, plain, &SOFTNESS, conorm, phi, upstream);
        let grads = (screen * Tensor::from_inner(gradient)).sum().backward();
        let gradient = world.grad(&grads).expect("the screen depends on the vertices");
        row(loss.inner(), alpha.inner(), gradient)
    }

    fn phi<B: Backend>(&self) -> Tensor<B, 1> {
        tensor(SOFTNESS.default_phi(SCALE), [1])
    }

    /// Vertices in world units, `[1, vertices, 3]`.
    fn world<B: Backend>(&self) -> Tensor<B, 3> {
        let positions = self.mesh.positions();
        tensor(positions.concat(), [1, positions.len(), 3])
    }

    /// Vertices of all views on the screen, `[views, vertices, 3]`.
    fn project<B: Backend>(&self, world: Tensor<B, 3>) -> Tensor<B, 3> {
        let [distance, elevation, half_angle] = CAMERA;
        let orbit = |&azimuth| [distance, elevation, azimuth, half_angle];
        let orbits: Vec<f64> = self.azimuths_deg.iter().flat_map(orbit).collect();
        project(world, tensor(orbits, [self.azimuths_deg.len(), 4]))
    }

    /// Mean squared difference of `alpha` `[views, size, size]` to the disk, `[1]`.
    fn loss<B: Backend>(&self, alpha: Tensor<B, 3>) -> Tensor<B, 1> {
        let (centre, radius) = DISK;
        let size = self.size as f64;
        // Membership is decided in f64: in f32 the rim would take other pixels.
        let inside = |pixel: usize| {
            let at = |index: usize| (2.0 * index as f64 + 1.0 - size) / size;
            let (row, column) = (pixel / self.size, pixel % self.size);
            let [x, y] = [at(column) - centre[0], -at(row) - centre[1]];
            f64::from(x * x + y * y <= radius * radius)
        };
        let disk: Vec<f64> = (0..self.size * self.size).map(inside).collect();
        let disk = tensor(disk, [1, self.size, self.size]).expand(alpha.dims());
        mse_loss(alpha, disk).mean()
    }
}

fn tensor<B: Backend, const D: usize>(values: Vec<f64>, shape: [usize; D]) -> Tensor<B, D> {
    let dtype = <B::FloatElem as Element>::dtype();
    Tensor::from_data(TensorData::new(values, shape), (&Default::default(), dtype))
}

fn row<B: Backend>(loss: Tensor<B, 1>, alpha: Tensor<B, 3>, gradient: Tensor<B, 3>) -> Row {
    let numbers = |data: TensorData| -> Vec<f64> { data.iter().collect() };
    let alpha = numbers(alpha.into_data());
    Row {
        loss: numbers(loss.into_data())[0],
        mean_alpha: alpha.iter().sum::<f64>() / alpha.len() as f64,
        gradient_norm: numbers(gradient.into_data()).iter().map(|g| g * g).sum::<f64>().sqrt(),
    }
}
