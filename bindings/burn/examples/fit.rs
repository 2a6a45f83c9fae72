//! Moves the vertices of a sphere until they fit two masks of a fox, with burn 0.22's own Adam.
//!
//! `cargo run --release --example fit`

use burn::module::Param;
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::Device;
use softrast_burn::softrast::{mesh, prelude::*};
use softrast_burn::{Silhouettes, project, vertex_tensor};

fn main() {
    for (step, loss) in fit(64, 200).iter().enumerate().step_by(20) {
        println!("step {step:3}: IoU loss {loss:.4}");
    }
}

/// The loss of each step on images of this size.
pub(crate) fn fit(size: usize, steps: usize) -> Vec<f32> {
    let device = Device::flex();
    let cameras = [[0.0, 0.0, -3.0], [3.0, 0.0, 0.0]]
        .map(|eye| Pinhole::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], 50.0, size));
    let draw = |mesh: &Mesh, width| {
        Silhouettes::new(SoftRenderer::new(mesh.faces(), size, Family::Gauss, width))
    };

    let (fox, sphere) = (mesh::fox(), mesh::icosphere(3));
    let masks =
        draw(&fox, 0.003).silhouette(project(vertex_tensor(fox.positions(), &device), &cameras)); // [2, size, size]
    let silhouettes = draw(&sphere, 0.03);
    let mut corners = Param::from_tensor(vertex_tensor(sphere.positions(), &device.autodiff())); // [1, V, 3]
    let mut adam = AdamConfig::new().init();
    let step = |_| {
        let loss = silhouettes.iou_loss(project(corners.val(), &cameras), masks.clone()).mean();
        let gradients = GradientsParams::from_grads(loss.backward(), &corners);
        corners = adam.step(0.01, corners.clone(), gradients);
        loss.into_scalar()
    };
    (0..steps).map(step).collect()
}
