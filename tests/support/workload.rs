//! A mesh in several views, and the result of its comparison with a disk.

use std::sync::Arc;

use softrast_mesh::Mesh;
use softrast_raster::{
    RasterBackend, TConorm, low_level::Rasterizer, mse_loss, project, reference,
};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, Tensor, numbers, tensor};

/// The logistic of the signed squared distance.
const SOFTNESS: EdgeSoftness = EdgeSoftness::squared(Family::Logistic);
/// Its scale in NDC².
const SCALE: f64 = 1e-4;
/// Distance (world units), elevation and field of view (degrees) of every camera.
const CAMERA: [f64; 3] = [2.732, 0.0, 60.0];
/// Centre and radius of the disk that images are compared with, in NDC.
const DISK: ([f64; 2], f64) = ([0.1, 0.05], 0.5);

/// A mesh in several views, compared with the image of a disk.
#[derive(Clone, Debug)]
pub struct Workload {
    /// The mesh, in world units.
    pub mesh: Mesh,
    /// Azimuths of the cameras in degrees.
    pub azimuths_deg: Vec<f64>,
    /// Width and height of the image in pixels.
    pub size: usize,
}

/// The result of a workload.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Mean squared difference to the disk over views and pixels.
    pub loss: f64,
    /// Mean coverage over views and pixels.
    pub mean_alpha: f64,
    /// Norm of the gradient of the loss with respect to the vertices in world units, all views together.
    pub gradient_norm: f64,
}

impl Row {
    /// Relative differences from `exact`: loss, mean coverage, gradient norm.
    pub fn errors(&self, exact: &Self) -> [f64; 3] {
        let error = |found: f64, exact: f64| (found / exact - 1.0).abs();
        [
            error(self.loss, exact.loss),
            error(self.mean_alpha, exact.mean_alpha),
            error(self.gradient_norm, exact.gradient_norm),
        ]
    }

    /// Asserts that the relative differences from `exact`, in the order of [`Row::errors`], are within
    /// `bounds`.
    ///
    /// # Panics
    ///
    /// If they are not.
    pub fn assert_agrees(&self, name: &str, exact: &Self, bounds: [f64; 3]) {
        let errors = self.errors(exact);
        println!("{name}, {self:?}: relative errors {errors:?}");
        // Written so that NaN does not agree.
        let close = errors.iter().zip(bounds).all(|(&error, bound)| error <= bound);
        assert!(close, "{name}: {self:?} is off by {errors:?} of {exact:?}");
    }
}

impl Workload {
    /// The result by the fused op with this tolerance, in the float type of `B`.
    ///
    /// # Panics
    ///
    /// If no part of the mesh is visible.
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
    /// If no part of the mesh is visible.
    pub fn by_reference<B: RasterBackend>(&self) -> Row {
        let scene = reference::Scene { faces: self.mesh.faces(), size: self.size.into() };
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

    /// The projected vertices of all views, `[views, vertices, 3]`.
    fn project<B: RasterBackend>(&self, world: Tensor<B, 3>) -> Tensor<B, 3> {
        let [distance, elevation, fov] = CAMERA;
        let orbit = |&azimuth| [distance, elevation, azimuth, fov];
        let orbits: Vec<f64> = self.azimuths_deg.iter().flat_map(orbit).collect();
        project(world, tensor(orbits, [self.azimuths_deg.len(), 4])).tensor()
    }

    /// Mean squared difference of `alpha` `[views, size, size]` to the disk, `[1]`.
    fn loss<B: RasterBackend>(&self, alpha: Tensor<B, 3>) -> Tensor<B, 1> {
        let (centre, radius) = DISK;
        let size = self.size as f64;
        // Membership is computed in f64: in f32 the rim would have other pixels.
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

fn row<B: Backend>(loss: Tensor<B, 1>, alpha: Tensor<B, 3>, gradient: Tensor<B, 3>) -> Row {
    let alpha = numbers(alpha);
    Row {
        loss: numbers(loss)[0],
        mean_alpha: alpha.iter().sum::<f64>() / alpha.len() as f64,
        gradient_norm: numbers(gradient).iter().map(|g| g * g).sum::<f64>().sqrt(),
    }
}
