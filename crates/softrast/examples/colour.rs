//! Fits the vertex colours of a fox to pictures, with burn's own Adam.
//!
//! `cargo run --release -p softrast --example colour`

use softrast::tensor::burn::{module::Param, optim::*};
use softrast::tensor::{Autodiff, NdArray};
use softrast::{mesh::fox, prelude::*};

type B = Autodiff<NdArray>;

fn main() {
    let (fox, device) = (fox(), Default::default());
    let front = Orbit { distance: 2.7, elevation_deg: 15.0, azimuth_deg: 0.0, fov_deg: 60.0 };
    let cameras = Orbit::tensors(&front.around(6), &device);
    let seen = project(vertex_tensor::<B>(fox.positions(), &device), cameras);
    let renderer = ColourRenderer::new(fox.faces(), 64, Family::Logistic, 0.005, seen.planes());
    let black = renderer.background(&[0.0; 3], &device);
    let draw = |colours: Tensor<B, 3>| {
        renderer.image(seen.clone(), &Attributes::of_vertices(colours, fox.faces()), &black)
    };
    // Pictures [6, 4, 64, 64], the last channel a mask; here of a fox whose colours follow its shape.
    let painted = fox.positions().iter().map(|p| p.map(|x| 0.5 + 0.5 * (6.0 * x).sin()));
    let pictures = draw(vertex_tensor(&painted.collect::<Vec<_>>(), &device));

    let grey = vec![[0.5; 3]; fox.positions().len()];
    let mut colours = Param::from_tensor(vertex_tensor::<B>(&grey, &device)); // [1, V, 3]
    let mut adam = AdamConfig::new().init();
    for step in 0..=80 {
        let loss = mse_loss(draw(colours.val()), pictures.clone()).mean();
        println!("step {step:2}: mean squared error {:.6}", loss.clone().into_scalar());
        let gradients = GradientsParams::from_grads(loss.backward(), &colours);
        colours = adam.step(0.05, colours, gradients);
    }
}
