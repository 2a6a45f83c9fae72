//! A softness of one's own: one method, and it is drawn and differentiated like those that come with the crate.
//!
//! `cargo run --release -p softrast --example own_softness`

use std::f64::consts::FRAC_1_PI;

use softrast::{mesh::fox, prelude::*, tensor::NdArray};

#[derive(Clone, Debug)]
struct Arctan;

impl Softness for Arctan {
    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        (x / phi.exp().reshape([1; D])).atan() * FRAC_1_PI + 0.5 // phi[0] is the logarithm of the scale
    }
}

fn main() {
    let (mesh, device) = (fox(), Default::default());
    let camera = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 30.0, fov_deg: 60.0 };
    let seen = project(vertices::<NdArray>(mesh.positions(), &device), camera.tensor(&device));
    // Its tails are long, and hundreds of faces add them up: a tiny scale, and a tolerance that keeps the support small.
    let renderer = SoftRenderer::new(mesh.faces(), 24, Arctan, 2e-5).with_tolerance(1e-3);
    let alpha: Vec<f64> = renderer.silhouette(seen).into_data().iter().collect();
    for row in alpha.chunks(24) {
        let shade = |&a: &f64| b" .:-=+*#%@"[(a * 9.99) as usize] as char;
        println!("{}", row.iter().flat_map(|a| [shade(a); 2]).collect::<String>());
    }
}
