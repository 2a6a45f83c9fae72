//! A soft silhouette, and its gradient with respect to the camera, the vertices and the softness.
//!
//! `cargo run --release -p softrast --example silhouette`

use softrast::{
    mesh::fox,
    prelude::*,
    tensor::{Autodiff, NdArray},
};

type B = Autodiff<NdArray>;

fn main() {
    let device = Default::default();
    let mesh = fox(); // or Mesh::load("my.obj")?
    let corners = vertex_tensor::<B>(mesh.positions(), &device).require_grad(); // [1, V, 3]
    let camera = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 30.0, fov_deg: 60.0 };
    let camera = camera.tensor::<B>(&device).require_grad(); // [1, 4]
    let renderer = SoftRenderer::new(mesh.faces(), 64, Family::Logistic, 0.01);
    let phi = renderer.phi_tensor::<B>(&device).require_grad();

    let alpha = renderer.silhouette_with(project(corners.clone(), camera.clone()), &phi); // [1, 64, 64]
    let gradients = alpha.clone().mean().backward();

    let norm = |gradient: Option<Tensor<NdArray, 3>>| {
        gradient.map(|gradient| gradient.powi_scalar(2).sum().sqrt().into_scalar())
    };
    println!("mean coverage        {:.4}", alpha.mean().into_scalar());
    println!(
        "gradient by camera   {:?}",
        camera.grad(&gradients).map(|g| Orbit::from_tensor(g)[0])
    );
    println!("by ln of the scale   {:?}", phi.grad(&gradients).map(|g| g.into_scalar()));
    println!("by vertices, norm    {:?}", norm(corners.grad(&gradients)));
}
