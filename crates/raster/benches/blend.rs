//! Times of a colour step and of a silhouette step over the same scene.
//!
//! ```text
//! cargo bench -p softrast-raster --bench blend            # all
//! cargo bench -p softrast-raster --bench blend -- W1      # those with W1 in their names
//! ```
//!
//! A step is an iteration of an optimisation: projection, image, mean squared difference, gradient with respect to the world vertices, and
//! in colour also to the vertex colours. Medians in `f32`, measured alternately; the edge softness is that of the silhouettes, and the
//! planes lie around the mesh. With a depth softness so wide that depths hardly matter, all faces have the support of a silhouette of
//! another tolerance, so both visit the same pairs. The last columns are the step at the default scale, where near faces have a larger
//! support, with all faces and with front faces only, with the loss as an op of its own and as one op with the image.

#[allow(dead_code, reason = "the other benchmark uses the rest")]
mod coloured;
mod machine;
#[allow(dead_code, reason = "the other benchmark uses the rest")]
mod workload;

use std::{hint::black_box, time::Instant};

use coloured::Coloured;
use softrast_raster::{ColourRenderer, SoftRenderer, low_level::Rasterizer, mse_loss, project};
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tensor::{Autodiff, DType, NdArray, Tensor};
use workload::{Workload, disk, tensor};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

type B = NdArray<f32>;
type A = Autodiff<B>;

/// Steps of each kind.
const STEPS: usize = 40;
/// A scale of the depth softness with which all depths between the planes have nearly the same weight.
const FLAT: f64 = 10.0;

fn main() {
    // Cargo adds the flag `--bench`.
    let filter = std::env::args().skip(1).find(|word| word != "--bench");
    println!("{}", machine::machine());
    println!(
        "| scene | threads | silhouette, ms | image, ms | colour, ms | ratio | default, ms | front, ms | one op, ms | front, ms |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let narrow = Workload {
        name: "W2, edges half a pixel wide".into(),
        width: 1.0 / 256.0,
        ..Workload::w2()
    };
    for workload in [Workload::w1(), Workload::w2(), narrow] {
        if filter.as_ref().is_some_and(|filter| !workload.name.contains(filter)) {
            continue;
        }
        let silhouettes = Silhouettes::new(&workload);
        let flat = Coloured::<B>::new(&workload, FLAT, DType::F32);
        let default = Coloured::<B>::new(&workload, ColourRenderer::DEPTH_SCALE, DType::F32);
        let front = default.clone().without_back_faces();
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.expect("threads can be started");
            let [silhouette, image, colour, default, front, fused, fused_front] =
                pool.install(|| {
                    medians([
                        &|| drop(black_box(silhouettes.step())),
                        &|| drop(black_box(flat.image())),
                        &|| drop(black_box(flat.step())),
                        &|| drop(black_box(default.step())),
                        &|| drop(black_box(front.step())),
                        &|| drop(black_box(default.fused_step())),
                        &|| drop(black_box(front.fused_step())),
                    ])
                });
            let ratio = colour / silhouette;
            println!(
                "| {} | {threads} | {silhouette:.2} | {image:.2} | {colour:.2} | {ratio:.2} | {default:.2} | {front:.2} | {fused:.2} | {fused_front:.2} |",
                workload.name
            );
        }
    }
}

/// Median milliseconds of each step, measured alternately.
fn medians<const N: usize>(steps: [&dyn Fn(); N]) -> [f64; N] {
    let mut times = [const { Vec::new() }; N];
    for _ in 0..STEPS {
        for (step, times) in steps.iter().zip(&mut times) {
            let start = Instant::now();
            step();
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    })
}

/// A workload as silhouettes.
struct Silhouettes {
    renderer: SoftRenderer<EdgeSoftness>,
    world: Tensor<B, 3>,
    cameras: Tensor<B, 2>,
    mask: Tensor<B, 3>,
}

impl Silhouettes {
    fn new(workload: &Workload) -> Self {
        // The background of an image has a weight of a thousandth, and half of the tolerance goes to culling in both.
        let tolerance = 1e-3 * (-1.0 / FLAT).exp() * Rasterizer::TOLERANCE;
        let (size, softness) = (workload.size, workload.softness);
        let rasterizer = Rasterizer { tolerance, ..Rasterizer::new(size) };
        let phi = softness.default_phi(workload.width * workload.width);
        let faces = workload.faces.clone();
        Self {
            renderer: SoftRenderer::with_rasterizer(rasterizer, faces, softness, phi),
            world: workload.world(DType::F32),
            cameras: workload.cameras(DType::F32),
            mask: tensor(&disk(size), [1, size, size], DType::F32),
        }
    }

    /// The gradient with respect to the world vertices, through the image.
    fn step(&self) -> Tensor<B, 3> {
        let world = Tensor::<A, 3>::from_inner(self.world.clone()).require_grad();
        let seen = project(world.clone(), Tensor::from_inner(self.cameras.clone()));
        let image = self.renderer.silhouette(seen);
        let loss = mse_loss(image, Tensor::from_inner(self.mask.clone())).mean();
        world.grad(&loss.backward()).expect("a gradient")
    }
}
