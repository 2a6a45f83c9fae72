//! A custom softness is one method. This one has heavy tails and is truncated; it then fits a sphere to 12 masks of a fox.
//!
//! `cargo run --release -p softrast --example own_softness`

use softrast::tensor::{Autodiff, NdArray, burn::optim::AdamConfig};
use softrast::{mesh, prelude::*};

#[derive(Clone, Debug)]
struct Arctan; // parameters p [1]: the logarithm of its scale

impl Softness for Arctan {
    fn value<B: Backend, const D: usize>(&self, p: Tensor<B, 1>, x: Tensor<B, D>) -> Tensor<B, D> {
        (x / p.exp().reshape([1; D])).atan() / std::f64::consts::PI + 0.5
    }
}

fn main() {
    let (fox, device) = (mesh::fox(), Default::default());
    let front = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 0.0, fov_deg: 60.0 };
    let cameras = Orbit::tensors::<Autodiff<NdArray>>(&front.around(12), &device);
    let seen = project(vertex_tensor(fox.positions(), &device), cameras.clone());
    let masks = hard_silhouette(seen, fox.faces(), [90, 120]);
    let mut shape = VertexModel::new(&mesh::icosphere(3), &device);
    let width = Width::pixels(1.0).to(0.1);
    // The image is 2.7 NDC wide: a softness with a larger reach draws every face at every pixel.
    let endless = SoftRenderer::new(shape.faces(), [90, 120], Arctan, width.at(0.0));
    let softness = Truncated::new(Arctan, 3.0); // the remedy
    let mut renderer = SoftRenderer::new(shape.faces(), [90, 120], softness, width.at(0.0));
    println!("reach {:.1e} NDC", endless.reach::<NdArray>());
    println!("reach {:.1e} NDC with an end", renderer.reach::<NdArray>());
    let mut adam = AdamConfig::new().init();
    for step in 0..200 {
        renderer.set_width(width.at(f64::from(step) / 199.0));
        let image = renderer.silhouette(project(shape.vertices(), cameras.clone()));
        let loss = iou_loss(image, masks.clone()).mean() + shape.laplacian() * 0.01;
        println!("step {step:3}: loss {:.4}", loss.clone().into_scalar());
        shape = shape.step(&mut adam, 0.01, loss);
    }
}
