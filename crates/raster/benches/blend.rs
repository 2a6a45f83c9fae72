//! Times of a step in colour against one of silhouettes, over the same scene.
//!
//! ```text
//! cargo bench -p softrast-raster --bench blend
//! ```
//!
//! A step is all that an optimisation does: projection, image, mean squared difference, gradient to the world vertices, and in colour to
//! the colours of the vertices too. Medians in `f32`, in turn; the edge softness is that of the silhouettes, and the planes lie around the
//! mesh. Under a depth softness that hardly tells one depth from another, all faces reach as far as those of a silhouette of another
//! tolerance, so that both visit the same pairs; the last column is the step at the default scale, where near faces reach farther.

mod machine;
#[allow(dead_code, reason = "the other benchmark uses the rest")]
mod workload;

use std::{hint::black_box, time::Instant};

use burn::{
    backend::{Autodiff, NdArray},
    tensor::{DType, Tensor},
};
use softrast_raster::{
    Attributes, ColourRenderer, Rasterizer, SoftRenderer, Weighting, mse_loss, project,
};
use softrast_softness::{DepthSoftness, Family, Softness};
use workload::{Workload, disk, tensor};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

type B = NdArray<f32>;
type A = Autodiff<B>;

/// Steps of each kind.
const STEPS: usize = 40;
/// Around a mesh that a camera sees from 2.732 away.
const PLANES: [f64; 2] = [1.7, 3.8];
const COLOURS: usize = 3;
/// A scale of the depth softness under which all depths between the planes count much the same.
const FLAT: f64 = 10.0;

fn main() {
    println!("{}", machine::machine());
    println!("| scene | threads | silhouette, ms | image, ms | colour, ms | ratio | default, ms |");
    println!("|---|---|---|---|---|---|---|");
    for workload in [Workload::w1(), Workload::w2()] {
        let scene = Scene::new(&workload);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.expect("threads can be started");
            let [silhouette, image, colour, default] = pool.install(|| {
                medians([
                    &|| scene.silhouette(),
                    &|| scene.image(&scene.flat),
                    &|| scene.colour(&scene.flat),
                    &|| scene.colour(&scene.deep),
                ])
            });
            let ratio = colour / silhouette;
            println!(
                "| {} | {threads} | {silhouette:.2} | {image:.2} | {colour:.2} | {ratio:.2} | {default:.2} |",
                workload.name
            );
        }
    }
}

/// Milliseconds of each, measured in turn.
fn medians<const N: usize>(steps: [&dyn Fn() -> f32; N]) -> [f64; N] {
    let mut times = [const { Vec::new() }; N];
    for _ in 0..STEPS {
        for (step, times) in steps.iter().zip(&mut times) {
            let start = Instant::now();
            black_box(step());
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    })
}

/// A scene in both ways.
struct Scene {
    world: Tensor<B, 3>,
    cameras: Tensor<B, 2>,
    colours: Attributes<B>,
    faces: std::sync::Arc<[[u32; 3]]>,
    silhouettes: SoftRenderer<softrast_softness::EdgeSoftness>,
    flat: ColourRenderer,
    deep: ColourRenderer,
    mask: Tensor<B, 3>,
    picture: Tensor<B, 4>,
}

impl Scene {
    fn new(workload: &Workload) -> Self {
        let (world, cameras) = (workload.world::<B>(DType::F32), workload.cameras(DType::F32));
        let [_, vertices, _] = world.dims();
        let phi = workload.softness.default_phi(workload.width * workload.width);
        let depth = DepthSoftness::Family(Family::Exp);
        let weighting = Weighting { edge: workload.softness, depth, planes: PLANES };
        let faces = workload.faces.clone();
        let phis = [phi.clone(), depth.default_phi(FLAT)];
        let wave = |k: usize| 0.5 + 0.5 * (0.1 * k as f64).sin();
        let colours: Vec<f64> = (0..COLOURS * vertices).map(wave).collect();
        let colours = tensor(&colours, [1, vertices, COLOURS], DType::F32);
        let size = workload.size;
        let mask = tensor::<B, 3>(&disk(size), [1, size, size], DType::F32);
        // The background weighs a thousandth, and half of the tolerance goes to culling here as there.
        let tolerance = 1e-3 * (-1.0 / FLAT).exp() * Rasterizer::TOLERANCE;
        let rasterizer = Rasterizer { tolerance, ..Rasterizer::new(size) };
        let flat = ColourRenderer::with_weighting(faces.clone(), size, weighting, phis);
        Self {
            silhouettes: SoftRenderer::with_rasterizer(
                rasterizer,
                faces.clone(),
                workload.softness,
                phi,
            ),
            deep: flat.clone().with_depth(depth, ColourRenderer::DEPTH_SCALE),
            flat,
            colours: Attributes::new(colours, faces.clone()),
            faces,
            picture: mask.clone().reshape([1, 1, size, size]).repeat_dim(1, COLOURS + 1),
            mask,
            world,
            cameras,
        }
    }

    fn silhouette(&self) -> f32 {
        let world = Tensor::<A, 3>::from_inner(self.world.clone()).require_grad();
        let seen = project(world.clone(), Tensor::from_inner(self.cameras.clone()));
        let image = self.silhouettes.silhouette(seen);
        let loss = mse_loss(image, Tensor::from_inner(self.mask.clone())).mean();
        world.grad(&loss.backward()).expect("a gradient").sum().into_scalar()
    }

    fn image(&self, renderer: &ColourRenderer) -> f32 {
        let seen = project(self.world.clone(), self.cameras.clone());
        let background = renderer.background(&[0.0; COLOURS], &Default::default());
        renderer.image(seen, &self.colours, &background).sum().into_scalar()
    }

    fn colour(&self, renderer: &ColourRenderer) -> f32 {
        let world = Tensor::<A, 3>::from_inner(self.world.clone()).require_grad();
        let colours = Tensor::<A, 3>::from_inner(self.colours.values().clone()).require_grad();
        let seen = project(world.clone(), Tensor::from_inner(self.cameras.clone()));
        let attributes = Attributes::new(colours.clone(), self.faces.clone());
        let background = renderer.background(&[0.0; COLOURS], &Default::default());
        let image = renderer.image(seen, &attributes, &background);
        let picture = Tensor::from_inner(self.picture.clone());
        let gradients = mse_loss(image, picture).mean().backward();
        let moved = world.grad(&gradients).expect("a gradient").sum();
        (moved + colours.grad(&gradients).expect("a gradient").sum()).into_scalar()
    }
}
