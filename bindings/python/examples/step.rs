//! The steps that `benches/steps.py` times, in Rust: `cargo run --release --example step -- [W2_MESH.obj]`. Without a mesh it is W1.
//! Prints the milliseconds with image and loss as two ops, and as one.

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
    let [mut two, mut one] = [Vec::new(), Vec::new()];
    for k in 0..440 {
        let (corners, whole) =
            (vertex_tensor::<B>(mesh.positions(), &device).require_grad(), k % 2 == 1);
        let start = Instant::now();
        let seen = project(corners.clone(), cameras.clone());
        let losses = if whole {
            renderer.mse_loss(seen, target.clone())
        } else {
            mse_loss(renderer.silhouette(seen), target.clone())
        };
        assert!(corners.grad(&losses.mean().backward()).is_some());
        (if whole { &mut one } else { &mut two }).push(1e3 * start.elapsed().as_secs_f64());
    }
    let [two, one] = [two, one].map(|mut times| {
        times.drain(..20);
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    println!("{two:.3} {one:.3}");
}
