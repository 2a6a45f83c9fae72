//! The step that `benches/steps.py` times, in Rust: `cargo run --release --example step -- [W2_MESH.obj]`. Without a mesh it is W1.

use std::time::Instant;

use softrast_mesh::{Mesh, icosphere};
use softrast_raster::{Orbit, SoftRenderer, mse_loss, project, vertex_tensor};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::{Autodiff, NdArray, Tensor};

type B = Autodiff<NdArray<f32>>;

fn main() {
    let device = Default::default();
    let (mesh, azimuths, size) = match std::env::args().nth(1) {
        Some(path) => (Mesh::load(path).expect("a mesh"), vec![180.0], 256),
        None => (icosphere(3), (0..24).map(|k| 15.0 * f64::from(k)).collect(), 64),
    };
    let orbit =
        |&azimuth_deg| Orbit { distance: 2.732, elevation_deg: 0.0, azimuth_deg, fov_deg: 60.0 };
    let cameras: Vec<_> = azimuths.iter().map(orbit).collect();
    let cameras = Orbit::tensors::<B>(&cameras, &device);
    let softness = EdgeSoftness::squared(Family::Logistic);
    let renderer = SoftRenderer::new(mesh.faces(), size, softness, 1e-4);
    let target = Tensor::<B, 3>::zeros([azimuths.len(), size, size], &device);
    let mut times = Vec::new();
    for _ in 0..220 {
        let corners = vertex_tensor::<B>(mesh.positions(), &device).require_grad();
        let start = Instant::now();
        let image = renderer.silhouette(project(corners.clone(), cameras.clone()));
        let gradients = mse_loss(image, target.clone()).mean().backward();
        assert!(corners.grad(&gradients).is_some());
        times.push(start.elapsed().as_secs_f64());
    }
    let times = &mut times[20..];
    times.sort_by(f64::total_cmp);
    println!("Rust {:.2} ms", 1e3 * times[times.len() / 2]);
}
