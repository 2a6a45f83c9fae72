//! A custom softness draws colours: a coloured fox moves until it fits a picture.
//!
//! `cargo run --release -p softrast --example own_colour`

use softrast::tensor::burn::{module::Param, optim::*};
use softrast::tensor::{Autodiff, NdArray};
use softrast::{mesh, prelude::*};

#[derive(Clone, Debug)]
struct Tanh; // p [1]: the logarithm of its scale

impl Softness for Tanh {
    fn value<B: Backend, const D: usize>(&self, p: Tensor<B, 1>, x: Tensor<B, D>) -> Tensor<B, D> {
        (x / p.exp().reshape([1; D])).tanh() * 0.5 + 0.5
    }
}

fn main() {
    let (fox, device) = (mesh::fox(), Default::default());
    let front = Orbit { distance: 2.7, elevation_deg: 15.0, azimuth_deg: 30.0, fov_deg: 60.0 };
    let corners = vertex_tensor::<Autodiff<NdArray>>(fox.positions(), &device);
    let seen =
        |by: Tensor<_, 3>| project(corners.clone() + by, Orbit::tensors(&front.around(3), &device));
    let colours = Attributes::of_vertices((corners.clone() * 3.0).sin() * 0.5 + 0.5, fox.faces());
    let renderer = ColourRenderer::new(fox.faces(), 64, Tanh, Width::pixels(1.0), [1.0, 4.0]);
    let black = renderer.background(&[0.0; 3], &device);
    let place = Tensor::from_floats([[[0.05, 0.1, -0.05]]], &device);
    let picture = renderer.image(seen(place), &colours, &black);
    let mut shift = Param::from_tensor(Tensor::zeros_like(&corners.clone().narrow(1, 0, 1)));
    let mut adam = AdamConfig::new().init();
    for step in 0..=100 {
        let image = renderer.image(seen(shift.val()), &colours, &black);
        let loss = mse_loss(image, picture.clone()).mean();
        println!("step {step:3}: mean squared error {:.6}", loss.clone().into_scalar());
        let gradients = GradientsParams::from_grads(loss.backward(), &shift);
        shift = adam.step(0.01, shift, gradients);
    }
    println!("shift {:?}", shift.val().into_data().to_vec::<f32>().expect("f32"));
}
