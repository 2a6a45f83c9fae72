//! Finds the colours of the vertices of a fox from pictures of it.
//!
//! `cargo run --release -p softrast --example colour`

use softrast::{
    mesh::fox,
    meta::{Adam, Optimizer},
    prelude::*,
    tensor::{Autodiff, NdArray},
};

type Plain = NdArray;
type B = Autodiff<Plain>;

const SIZE: usize = 64;
const STEPS: usize = 80;

fn main() {
    let device = Default::default();
    let front = Orbit { distance: 2.7, elevation_deg: 15.0, azimuth_deg: 0.0, fov_deg: 60.0 };
    let cameras =
        [0.0, 60.0, 120.0, 180.0, 240.0, 300.0].map(|azimuth_deg| Orbit { azimuth_deg, ..front });
    let fox = fox();
    let seen =
        project(vertices(fox.positions(), &device), Orbit::tensors::<Plain>(&cameras, &device));

    // The fox lies between these planes; one pixel is 2 / 64 wide.
    let renderer = ColourRenderer::new(fox.faces(), SIZE, Family::Logistic, 0.005, seen.planes());
    let background = renderer.background::<Plain>(&[0.0, 0.0, 0.0], &device);

    // Pictures `[6, 4, 64, 64]`, the last channel a mask; here of a fox whose colours follow its shape.
    let painted = fox.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * (6.0 * x).sin()));
    let painted = vertices::<Plain>(&painted.collect::<Vec<_>>(), &device);
    let pictures =
        renderer.image(seen.clone(), &Attributes::of_vertices(painted, fox.faces()), &background);

    let behind = renderer.background::<B>(&[0.0, 0.0, 0.0], &device);
    let mut colours = vertices::<Plain>(&vec![[0.5; 3]; fox.positions().len()], &device); // [1, V, 3]
    let adam = Adam::new(0.05);
    let mut state = adam.init(&colours);
    for step in 0..=STEPS {
        let leaf = Tensor::<B, 3>::from_inner(colours.clone()).require_grad();
        let attributes = Attributes::of_vertices(leaf.clone(), fox.faces());
        let image = renderer.image(Projected::from_inner(seen.clone()), &attributes, &behind);
        let off = image - Tensor::from_inner(pictures.clone());
        let loss = off.powi_scalar(2).mean();
        if step % 20 == 0 {
            println!("step {step:2}: mean squared error {:.6}", loss.clone().into_scalar());
        }
        let gradient = leaf.grad(&loss.backward()).expect("the image depends on it");
        (colours, state) = adam.step(colours, gradient, state);
    }
}
