//! Moves the vertices of a sphere until it fits two silhouettes. A scale that narrows finds the shape first and its edges later.
//!
//! `cargo run --release -p softrast --example fit`

use softrast::{
    mesh::{fox, icosphere},
    meta::{Adam, Optimizer},
    prelude::*,
    tensor::{Autodiff, NdArray},
};

type Plain = NdArray;
type B = Autodiff<Plain>;

const SIZE: usize = 64;
const STEPS: usize = 200;

fn main() {
    let device = Default::default();
    let front = Orbit { distance: 3.0, elevation_deg: 0.0, azimuth_deg: 0.0, fov_deg: 50.0 };
    let cameras = [front, Orbit { azimuth_deg: 90.0, ..front }];

    // Masks `[2, 64, 64]` of 0 and 1, top row first; here those of a fox.
    let fox = fox();
    let seen = project(vertices(fox.positions(), &device), Orbit::tensors(&cameras, &device));
    let masks: Tensor<B, 3> = hard_silhouette(seen, fox.faces(), SIZE);

    let (sphere, cameras) = (icosphere(3), Orbit::tensors::<B>(&cameras, &device));
    let logistic = EdgeSoftness { family: Family::Logistic, squared: false };
    let decay = ScheduledSoftness::decay(logistic, 0.05, 0.005);
    let mut renderer = SoftRenderer::new(sphere.faces(), SIZE, logistic, 0.05);
    let mut corners = vertices::<Plain>(sphere.positions(), &device);
    let adam = Adam::new(0.01);
    let mut state = adam.init(&corners);
    for step in 0..=STEPS {
        renderer.set_phi(decay.phi_at(step as f64 / STEPS as f64, SIZE));
        let leaf = Tensor::<B, 3>::from_inner(corners.clone()).require_grad();
        let image = renderer.silhouette(project(leaf.clone(), cameras.clone()));
        let loss = iou_loss(image, masks.clone()).mean();
        if step % 50 == 0 {
            println!("step {step:3}: IoU loss {:.4}", loss.clone().into_scalar());
        }
        let gradient = leaf.grad(&loss.backward()).expect("the image depends on it");
        (corners, state) = adam.step(corners, gradient, state);
    }
}
