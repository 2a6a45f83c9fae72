//! Derivatives of the loss against central differences, in f64.

use burn::{
    backend::{Autodiff, NdArray},
    tensor::{DType, Tensor, TensorData},
};
use shape3d::{Instance, Scene};
use softrast_mesh::{airplane, icosphere};
use softrast_meta::{Adam, InnerLoop, Objective};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette};
use softrast_softness::{EdgeSoftness, Family};

type B = NdArray<f64>;
type A = Autodiff<B>;

const SIZE: usize = 12;
const SOFTNESS: EdgeSoftness = EdgeSoftness { family: Family::Logistic, squared: false };
const SCALE: f64 = 0.05;
/// Step of the differences in θ and φ.
const H: f64 = 1e-5;

fn tensor<B: RasterBackend>(values: Vec<f64>) -> Tensor<B, 1> {
    let shape = [values.len()];
    Tensor::from_data(TensorData::new(values, shape), (&Default::default(), DType::F64))
}

fn numbers<B: RasterBackend>(tensor: Tensor<B, 1>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

/// The whole loss of a small sphere against the airplane.
struct Small {
    silhouette: Silhouette<EdgeSoftness>,
}

impl Small {
    fn new() -> Self {
        let rasterizer = Rasterizer { tolerance: 1e-10, ..Rasterizer::new(SIZE) };
        let near = tensor::<B>(SOFTNESS.default_phi(SCALE));
        Self { silhouette: rasterizer.prepare(&icosphere(0).faces().into(), SOFTNESS, &near) }
    }
}

impl<B: RasterBackend> Objective<B> for Small {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>) -> Tensor<B, 1> {
        let instance = Instance { elevation_deg: 30.0, turn: 3 };
        let scene = Scene::<B>::new(&airplane(), &icosphere(0), &instance, SIZE);
        let vertices = scene.vertices(theta);
        let image = self.silhouette.coverage(scene.project(vertices.clone()), phi);
        scene.image_loss(image) + scene.smoothness_loss(vertices)
    }
}

/// Somewhere that is no symmetric place: `[3 * 12 + 3]`.
fn theta() -> Vec<f64> {
    (0..39).map(|k| 0.3 * (1.7 * f64::from(k)).sin()).collect()
}

fn loss(small: &Small, theta: Vec<f64>, phi: Vec<f64>) -> f64 {
    numbers::<B>(small.loss(tensor(theta), tensor(phi)))[0]
}

#[test]
fn the_gradient_matches_central_differences() {
    let small = Small::new();
    let phi = SOFTNESS.default_phi(SCALE);
    let leaf = tensor::<A>(theta()).require_grad();
    let grads = small.loss(leaf.clone(), tensor(phi.clone())).backward();
    let grad = numbers(leaf.grad(&grads).unwrap());
    let largest = grad.iter().fold(0.0, |largest: f64, g| largest.max(g.abs()));
    for (k, grad) in grad.into_iter().enumerate() {
        let at = |h: f64| {
            let mut moved = theta();
            moved[k] += h;
            loss(&small, moved, phi.clone())
        };
        let slope = (at(H) - at(-H)) / (2.0 * H);
        let off = (slope - grad).abs() / largest;
        assert!(off < 1e-6, "entry {k}: {slope} and {grad}, off by {off:.1e}");
    }
}

#[test]
fn the_meta_gradient_through_two_steps_matches_central_differences() {
    let small = Small::new();
    let inner = InnerLoop { optimizer: Adam::new(0.03), steps: 2 };
    let start = SOFTNESS.default_phi(SCALE);
    let phi = tensor::<A>(start.clone()).require_grad();
    let end = inner.solve(&small, tensor::<A>(theta()), &phi);
    let grads = small.loss(end, phi.clone()).backward();
    let grad = numbers(phi.grad(&grads).unwrap())[0];
    let at = |h: f64| {
        let phi = vec![start[0] + h];
        let end = inner.solve(&small, tensor::<B>(theta()), &tensor(phi.clone()));
        loss(&small, numbers(end), phi)
    };
    let slope = (at(H) - at(-H)) / (2.0 * H);
    assert!((slope / grad - 1.0).abs() < 1e-5, "{slope} and {grad}");
}
