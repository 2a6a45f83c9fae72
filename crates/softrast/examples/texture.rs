//! Finds the texture of a fox from pictures of it in a light that is known.
//!
//! `cargo run --release -p softrast --example texture`

use softrast::{
    meta::{Adam, Optimizer},
    prelude::*,
    raster::*,
    tensor::{Autodiff, NdArray},
};

type Plain = NdArray;
type B = Autodiff<Plain>;

const SIZE: usize = 64;
const TEXELS: usize = 64;
const STEPS: usize = 60;

fn main() {
    let device = Default::default();
    let fox = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/meshes/fox.glb");
    let (fox, _) = Mesh::load_textured(fox).expect("the mesh comes with the project");
    let coordinates = fox.texture().expect("it has a texture");
    let places: Vec<f32> = coordinates.coordinates().iter().flatten().map(|&x| x as f32).collect();
    let places = Tensor::<Plain, 1>::from_floats(&places[..], &device).reshape([1, -1, 2]);
    let front = Orbit { distance: 2.7, elevation_deg: 15.0, azimuth_deg: 0.0, fov_deg: 60.0 };
    let cameras =
        [0.0, 60.0, 120.0, 180.0, 240.0, 300.0].map(|azimuth_deg| Orbit { azimuth_deg, ..front });
    let world = vertices::<Plain>(fox.positions(), &device);
    let seen = project(world.clone(), Orbit::tensors(&cameras, &device));
    let renderer = ColourRenderer::new(fox.faces(), SIZE, Family::Logistic, 0.005, seen.planes());
    // What each vertex throws back of a lamp, drawn once, since neither the shape nor the lamp moves.
    let [towards, colour] = [[0.5, 1.0, -0.5], [1.0; 3]].map(|x| Tensor::from_floats(x, &device));
    let normals = vertex_normals(world.clone(), fox.faces());
    let lit = lambert(world, normals, &[Light::Directional { towards, colour }]) * 0.7 + 0.3;
    let one = renderer.background::<Plain>(&[1.0; 3], &device);
    let lit = Attributes::of_vertices(lit, fox.faces());
    let light = renderer.image(seen.clone(), &lit, &one).narrow(1, 0, 3);
    // Pictures `[6, 3, 64, 64]` of a fox with waves of colour.
    let black = renderer.background::<Plain>(&[0.0; 3], &device);
    let waves = (0..3 * TEXELS * TEXELS).map(|k| 0.5 + 0.5 * (0.11 * k as f32).sin());
    let waves = Tensor::<Plain, 1>::from_floats(&waves.collect::<Vec<_>>()[..], &device);
    let paint = Attributes::new(places.clone(), coordinates.corners().into());
    let painted = paint.with_texture(waves.reshape([TEXELS, TEXELS, 3]));
    let pictures = renderer.image(seen.clone(), &painted, &black).narrow(1, 0, 3) * light.clone();
    let behind = renderer.background::<B>(&[0.0; 3], &device);
    let paint = Attributes::new(Tensor::from_inner(places), coordinates.corners().into());
    let mut texture = Tensor::<Plain, 3>::full([TEXELS, TEXELS, 3], 0.5, &device);
    let adam = Adam::new(0.05);
    let mut state = adam.init(&texture);
    for step in 0..=STEPS {
        let leaf = Tensor::<B, 3>::from_inner(texture.clone()).require_grad();
        let painted = paint.clone().with_texture(leaf.clone());
        let image = renderer.image(Projected::from_inner(seen.clone()), &painted, &behind);
        let lit = image.narrow(1, 0, 3) * Tensor::from_inner(light.clone());
        let loss = mse_loss(lit, Tensor::from_inner(pictures.clone())).mean();
        if step % 20 == 0 {
            println!("step {step:2}: mean squared error {:.6}", loss.clone().into_scalar());
        }
        let gradient = leaf.grad(&loss.backward()).expect("the image depends on it");
        (texture, state) = adam.step(texture, gradient, state);
    }
}
