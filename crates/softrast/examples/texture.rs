//! Fits the texture of a fox to pictures under known light, with burn's own Adam.
//!
//! `cargo run --release -p softrast --example texture`

use softrast::tensor::burn::{module::Param, optim::*};
use softrast::tensor::{Autodiff, Int, NdArray};
use softrast::{mesh::fox, prelude::*, raster::*};

type B = Autodiff<NdArray>;

fn main() {
    let (fox, device) = (fox(), Default::default());
    let front = Orbit { distance: 2.7, elevation_deg: 15.0, azimuth_deg: 0.0, fov_deg: 60.0 };
    let world = vertex_tensor::<B>(fox.positions(), &device);
    let seen = project(world.clone(), Orbit::tensors(&front.around(6), &device));
    let renderer = ColourRenderer::new(fox.faces(), 64, Family::Logistic, 0.005, seen.planes());
    let [towards, colour] = [[0.5, 1.0, -0.5], [1.0; 3]].map(|x| Tensor::from_floats(x, &device));
    let normals = vertex_normals(world.clone(), fox.faces());
    let lit = lambert(world.clone(), normals, &[Light::Directional { towards, colour }]);
    let light = Attributes::of_vertices(lit * 0.7 + 0.3, fox.faces());
    let light = renderer.image(seen.clone(), &light, &renderer.background(&[1.0; 3], &device));
    // x and y are texture coordinates; a file has its own: Mesh::load_textured("fox.glb")?
    let places = Attributes::of_vertices(world.narrow(2, 0, 2) * 0.5 + 0.5, fox.faces());
    let black = renderer.background(&[0.0; 3], &device);
    let draw = |texture: Tensor<B, 3>| {
        let painted = places.clone().with_texture(texture);
        renderer.image(seen.clone(), &painted, &black) * light.clone() // [6, 4, 64, 64]
    };
    let waves = (Tensor::<B, 1, Int>::arange(0..64 * 64 * 3, &device).float() * 0.11).sin();
    let pictures = draw(waves.reshape([64, 64, 3]) * 0.5 + 0.5);
    let mut texture = Param::from_tensor(Tensor::<B, 3>::full([64, 64, 3], 0.5, &device));
    let mut adam = AdamConfig::new().init();
    for step in 0..=60 {
        let loss = mse_loss(draw(texture.val()), pictures.clone()).mean();
        println!("step {step:2}: mean squared error {:.6}", loss.clone().into_scalar());
        let gradients = GradientsParams::from_grads(loss.backward(), &texture);
        texture = adam.step(0.05, texture, gradients);
    }
}
