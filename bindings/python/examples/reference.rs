//! Reference numbers of the Python tests, computed in Rust alone: `cargo run --release --example reference > reference.txt`.
//!
//! A line has a name and the bits of its numbers, in hexadecimal.

use softrast_meta::{Adam, InnerLoop, Objective};
use softrast_raster::{
    Attributes, Background, ColourRenderer, Orbit, Projected, RasterBackend, SoftRenderer, project,
};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor, numbers, tensor, vector};

type Plain = NdArray<f64>;
type Outer = Autodiff<Plain>;
type Inner = Autodiff<Outer>;

const SIZE: [usize; 2] = [12, 10];
const LOGISTIC: EdgeSoftness = EdgeSoftness::new(Family::Logistic);

fn main() {
    silhouettes();
    colours();
    meta_gradient();
}

fn line<B: Backend, const D: usize>(name: &str, tensor: Tensor<B, D>) {
    let numbers = numbers(tensor).into_iter();
    let bits: Vec<_> = numbers.map(|number| format!("{:016x}", number.to_bits())).collect();
    println!("{name} {}", bits.join(" "));
}

/// Numbers in [-1, 1] that floats hold exactly.
fn pattern<B: Backend, const D: usize>(shape: [usize; D]) -> Tensor<B, D> {
    let number = |k: usize| (k * 37 % 17) as f64 / 8.0 - 1.0;
    tensor((0..shape.iter().product()).map(number).collect(), shape)
}

fn outer<const D: usize>(tensor: Tensor<Plain, D>) -> Tensor<Outer, D> {
    Tensor::<Outer, D>::from_inner(tensor).require_grad()
}

fn inner<const D: usize>(tensor: &Tensor<Outer, D>) -> Tensor<Inner, D> {
    Tensor::<Inner, D>::from_inner(tensor.clone()).require_grad()
}

fn positions() -> Tensor<Plain, 3> {
    let mesh = softrast_mesh::icosphere(1);
    tensor(mesh.positions().concat(), [1, mesh.positions().len(), 3])
}

fn cameras() -> Tensor<Plain, 2> {
    let orbit =
        |azimuth_deg| Orbit { distance: 2.5, elevation_deg: 10.0, azimuth_deg, fov_deg: 60.0 };
    Orbit::tensors(&[orbit(20.0), orbit(75.0)], &Default::default())
}

/// An image, the gradients of a weighted sum of it, and those of a weighted sum of the one to the vertices.
fn silhouettes() {
    let mesh = softrast_mesh::icosphere(1);
    let renderer = SoftRenderer::new(mesh.faces(), SIZE, LOGISTIC, 0.05);
    let [vertices, cameras, phi] =
        [positions().reshape([-1]), cameras().reshape([-1]), vector(renderer.phi())].map(outer);
    let leaves = [&vertices, &cameras, &phi].map(inner);
    let [points, orbits, parameters] = leaves.clone();
    let seen = project(points.reshape([1, -1, 3]), orbits.reshape([-1, 4]));
    let image = renderer.silhouette_with(seen, &parameters);
    line("image", image.clone());
    let gradients = (image.clone() * pattern(image.dims())).sum().backward();
    let first = leaves.map(|leaf| leaf.grad(&gradients).expect("the image depends on it"));
    for (name, gradient) in ["vertices", "cameras", "phi"].into_iter().zip(&first) {
        line(name, gradient.clone());
    }
    let [by_vertices, ..] = first;
    let gradients = (by_vertices.clone() * pattern(by_vertices.dims())).sum().backward();
    for (name, leaf) in [("vertices2", vertices), ("cameras2", cameras), ("phi2", phi)] {
        line(name, leaf.grad(&gradients).expect("the gradient depends on it"));
    }
}

/// Numbers of an image in colours.
fn colours() {
    let mesh = softrast_mesh::icosphere(1);
    let renderer = ColourRenderer::new(mesh.faces(), SIZE, Family::Logistic, 0.05, [1.5, 3.5]);
    let seen = project::<Plain>(positions(), cameras()).tensor();
    let [_, count, _] = seen.dims();
    let [edge, depth] = renderer.phi().each_ref().map(|phi| outer(vector(phi)));
    let behind = renderer.background::<Plain>(&[0.25, 0.5], &Default::default());
    let (vertices, values) = (outer(seen), outer(pattern([1, count, 2])));
    let (colour, log_weight) = (outer(behind.colour), outer(behind.log_weight));
    let (points, shown) = (inner(&vertices), inner(&values));
    let [parameters, parameters_depth] = [&edge, &depth].map(inner);
    let [plain, weight] = [&colour, &log_weight].map(inner);
    let image = renderer.image_with(
        Projected::new(points.clone()),
        &Attributes::of_vertices(shown.clone(), mesh.faces()),
        [&parameters, &parameters_depth],
        &Background { colour: plain.clone(), log_weight: weight.clone() },
    );
    line("blend", image.clone());
    let gradients = (image.clone() * pattern(image.dims())).sum().backward();
    let by_vertices = points.grad(&gradients).expect("the image depends on it");
    line("blend-vertices", by_vertices.clone());
    line("blend-attributes", shown.grad(&gradients).expect("the image depends on it"));
    for (name, leaf) in [
        ("blend-phi", parameters),
        ("blend-phi_depth", parameters_depth),
        ("blend-background", plain),
        ("blend-log_weight", weight),
    ] {
        line(name, leaf.grad(&gradients).expect("the image depends on it"));
    }
    let gradients = (by_vertices.clone() * pattern(by_vertices.dims())).sum().backward();
    line("blend-vertices2", vertices.grad(&gradients).expect("the gradient depends on it"));
    line("blend-attributes2", values.grad(&gradients).expect("the gradient depends on it"));
    for (name, leaf) in [
        ("blend-phi2", edge),
        ("blend-phi_depth2", depth),
        ("blend-background2", colour),
        ("blend-log_weight2", log_weight),
    ] {
        let nothing = || leaf.clone().inner().zeros_like();
        line(name, leaf.grad(&gradients).unwrap_or_else(nothing));
    }
}

/// Elevation and azimuth of a camera, from their silhouette.
struct Pose {
    renderer: SoftRenderer<EdgeSoftness>,
    target: Tensor<Plain, 3>,
}

impl Pose {
    fn image<B: RasterBackend>(&self, angles: Tensor<B, 1>, phi: &Tensor<B, 1>) -> Tensor<B, 3> {
        let camera = Tensor::cat(vec![vector(&[2.7]), angles, vector(&[60.0])], 0).reshape([1, 4]);
        let mesh = softrast_mesh::fox();
        let points = tensor(mesh.positions().concat(), [1, mesh.positions().len(), 3]);
        self.renderer.silhouette_with(project(points, camera), phi)
    }
}

impl Objective<Inner> for Pose {
    fn loss(
        &self,
        theta: Tensor<Inner, 1>,
        phi: Tensor<Inner, 1>,
        _step: usize,
    ) -> Tensor<Inner, 1> {
        let target = Tensor::from_inner(Tensor::from_inner(self.target.clone()));
        (self.image(theta, &phi) - target).powi_scalar(2).mean()
    }
}

/// How far 30 steps of Adam end from the answer, and the derivative of that by φ.
fn meta_gradient() {
    let mesh = softrast_mesh::fox();
    let renderer = SoftRenderer::new(mesh.faces(), 32, LOGISTIC, 0.05);
    let target = Tensor::zeros([1, 32, 32], &Default::default());
    let mut pose = Pose { renderer, target };
    let sharp = vector(&[0.01_f64.ln()]);
    pose.target = pose.image::<Plain>(vector(&[20.0, 30.0]), &sharp);
    let phi = outer(vector(pose.renderer.phi()));
    let inner = InnerLoop { optimizer: Adam::new(1.0), steps: 30 };
    let found = inner.solve(&pose, vector(&[10.0, 45.0]), &phi);
    let off = (found - vector(&[20.0, 30.0])).powi_scalar(2).sum();
    line("meta-loss", off.clone());
    line("meta-phi", phi.grad(&off.backward()).expect("every step depends on it"));
}
