//! A meta-gradient by hand: the derivative of the error after ten steps of gradient descent with respect to the softness.
//!
//! `cargo run --release -p softrast --example meta_gradient`

use softrast::tensor::{Autodiff, NdArray};
use softrast::{mesh::fox, prelude::*};

type Outer = Autodiff<NdArray<f64>>;
type Inner = Autodiff<Outer>; // differentiable twice

fn main() {
    let (mesh, device) = (fox(), Default::default());
    let camera = Orbit { distance: 2.7, elevation_deg: 10.0, azimuth_deg: 0.0, fov_deg: 60.0 };
    let seen = project::<Inner>(vertex_tensor(mesh.positions(), &device), camera.tensor(&device));
    let target = hard_silhouette(seen, mesh.faces(), 32);
    let renderer = SoftRenderer::new(mesh.faces(), 32, Family::Logistic, 0.02);
    let phi = renderer.phi_tensor::<Outer>(&device).require_grad();
    let start = Orbit { elevation_deg: 22.0, azimuth_deg: 15.0, ..camera };
    let mut pose = start.tensor::<Outer>(&device);
    // Only the angles move.
    let rates = Orbit { distance: 0.0, elevation_deg: 300.0, azimuth_deg: 300.0, fov_deg: 0.0 };
    for step in 0..10 {
        // One level further in: its gradient is an ordinary tensor of `Outer`, tracked back to `phi`.
        let leaf = Tensor::<Inner, 2>::from_inner(pose.clone()).require_grad();
        let corners = project(vertex_tensor(mesh.positions(), &device), leaf.clone());
        let image = renderer.silhouette_with(corners, &Tensor::from_inner(phi.clone()));
        let loss = iou_loss(image, target.clone()).mean();
        println!("step {step}: IoU loss {:.4}", loss.clone().into_scalar());
        let gradient = leaf.grad(&loss.backward()).expect("the image depends on the pose");
        pose = pose - gradient * rates.tensor(&device);
    }
    let outer_loss = (pose - camera.tensor(&device)).powi_scalar(2).sum();
    println!("squared error of the pose: {:.3}", outer_loss.clone().into_scalar());
    let by_phi = phi.grad(&outer_loss.backward()).expect("every step depends on the softness");
    println!("its derivative by the logarithm of the scale: {:.3}", by_phi.into_scalar());
}
